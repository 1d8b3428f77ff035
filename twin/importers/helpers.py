"""Chains of joints through bodies without a shape: two joints for one part, as PartNet-Mobility has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from twin.errors import InputError
from twin.importers.joints import has_range
from twin.importers.source import Source, SourceBody


def without_helpers(
    source: Source,
    bodies: Sequence[SourceBody],
    limits: Mapping[str, tuple[float, float]],
    notes: list[str],
) -> list[SourceBody]:
    """The bodies; the joint of a helper is held at rest where it has no range.

    A helper is a body on a joint, with all that is fixed to it, that has no shape and carries another joint.

    Raises:
        InputError: a helper's joint has a range, so that the part needs both; names the body to exclude.
    """
    home: dict[str, str | None] = {}
    solid: set[str | None] = set()
    carries: dict[str, SourceBody] = {}
    for body in bodies:
        above = home.get(body.parent or "")
        home[body.name] = body.name if body.joint is not None else above
        if body.visual or body.collision:
            solid.add(home[body.name])
        if body.joint is not None and above is not None:
            carries.setdefault(above, body)
    kept = []
    for body in bodies:
        on = carries.get(body.name)
        if body.joint is None or on is None or body.name in solid:
            kept.append(body)
            continue
        assert on.joint is not None
        chain = (
            f"joint {body.joint.name!r} moves body {body.name!r}, which has no shape, and joint {on.joint.name!r}"
            f" moves {on.name!r} on it"
        )
        if has_range(*limits.get(body.joint.name, (body.joint.lower, body.joint.upper))):
            raise InputError(
                f"{source.path}: {chain}: a part has one joint",
                f"leave all of it out with --exclude {body.name}, or make one of the joints fixed in the file",
            )
        notes.append(f"{chain}: the first has no range and is held at rest")
        kept.append(replace(body, joint=None))
    return kept
