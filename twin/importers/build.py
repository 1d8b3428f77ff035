"""From what a reader found to a twin: fixed bodies join, joints start closed, gaps are filled."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from twin.atlas import MOST_TEXELS, joined_textures
from twin.errors import InputError, SceneError, nearest_name
from twin.geometry import Array
from twin.importers.closed_end import travel_of
from twin.importers.groups import Group, around, groups_of
from twin.importers.helpers import without_helpers
from twin.importers.joints import joint_of, range_of
from twin.importers.source import WORLD, Closed, Source, SourceBody, moved
from twin.importers.stated import stated_inertial, with_stated
from twin.importers.twin_pairs import filtered_pairs
from twin.names import legal_name
from twin.physics import with_physics
from twin.scene import (
    FIRST_PART_ID,
    HAND_LABEL,
    Collision,
    Mesh,
    Motion,
    Part,
    StaticPart,
    Twin,
)


def build(
    source: Source,
    closed: Mapping[str, Closed],
    limits: Mapping[str, tuple[float, float]],
    exclude: Sequence[str],
) -> Twin:
    """The twin of a file, and UserWarnings of what is lost. Raises InputError that names the element."""
    notes = list(source.notes)
    bodies = without_helpers(source, _carried(source, exclude, notes), limits, notes)
    groups = groups_of(bodies)
    moving = [g.first for g in groups if g.first is not None]
    for asked, what in ((closed, "closed"), (limits, "limits")):
        _require_known(source, asked, [b.joint.name for b in moving if b.joint is not None], what)
    if len(moving) > HAND_LABEL - FIRST_PART_ID:
        raise InputError(
            f"{source.path} has {len(moving)} moving bodies, a twin at most {HAND_LABEL - FIRST_PART_ID}",
            "leave some out with exclude",
        )
    taken: list[str] = []
    static = _static(groups[0], taken, notes)
    parts = _parts(source, groups, closed, limits, taken, notes)
    twin = Twin(legal_name(source.name), static, parts)
    try:
        twin = with_physics(twin)
    except SceneError as e:
        raise InputError(f"{source.path}: {e.problem}", e.remedy) from e
    stated = tuple(
        with_stated(source, part, group.bodies) for part, group in zip(twin.parts, groups[1:], strict=True)
    )
    for note in notes:
        warnings.warn(f"{source.path.name}: {note}", UserWarning, stacklevel=4)
    pairs = filtered_pairs(source, twin, [g.bodies for g in groups])
    return replace(twin, parts=stated, filtered_pairs=pairs)


def _carried(source: Source, exclude: Sequence[str], notes: list[str]) -> list[SourceBody]:
    """Bodies without what the user leaves out and without what stands loose, nor what hangs on either."""
    names = [b.name for b in source.bodies]
    for pattern in exclude:
        if not any(fnmatchcase(n, pattern) for n in names):
            close = nearest_name(pattern, names)
            hint = f"did you mean {close!r}?" if close else f"there are: {', '.join(names[:12])}"
            raise InputError(f"{source.path} has no body {pattern!r} to leave out", hint)
    gone: set[str] = set()
    kept = []
    for body in source.bodies:
        left_out = any(fnmatchcase(body.name, pattern) for pattern in exclude)
        if left_out or body.parent in gone:
            gone.add(body.name)
        elif body.loose:
            gone.add(body.name)
            notes.append(
                f"body {body.name!r} stands loose and is left out: a twin has hinges and slides only"
            )
        elif body.refused:
            raise InputError(
                f"{source.path}: body {body.name!r} moves as no part of a twin can: {body.refused}",
                "a part has one hinge or one slide: leave the body out with exclude, or change the file",
            )
        else:
            kept.append(body)
    return kept


def _require_known(source: Source, asked: Mapping[str, object], known: Sequence[str], what: str) -> None:
    for name in asked:
        if name not in known:
            close = nearest_name(name, list(known))
            hint = f"did you mean {close!r}? " if close else ""
            raise InputError(
                f"{what}: {source.path} has no movable joint {name!r}",
                f"{hint}its joints: {', '.join(known) or 'none'}",
            )


def _surfaces(group: Group, notes: list[str]) -> Mesh:
    """What is seen of a group as one mesh, its pictures packed into one."""
    mesh, scale = joined_textures(group.surfaces)
    if scale < 1:
        name = group.bodies[0].name if group.first is not None else "what does not move"
        notes.append(
            f"{name}: its pictures are shrunk to {100 * scale:.0f} % to fit into {MOST_TEXELS} texels a side"
        )
    return mesh


def _shapes(group: Group) -> tuple[Collision, ...]:
    """The group's collision shapes; none, so that they are made, when some can't be used."""
    return tuple(c for b in group.bodies for c in b.collision) if all(b.shapes for b in group.bodies) else ()


def _static(group: Group, taken: list[str], notes: list[str]) -> StaticPart:
    """What does not move, named after its only body, if it is one."""
    solid = [b.name for b in group.bodies if b.visual or b.collision]
    name = legal_name(solid[0] if len(solid) == 1 and solid[0] != WORLD else "static")
    taken.append(name)
    return StaticPart(name, _surfaces(group, notes), _shapes(group))


def _parts(
    source: Source,
    groups: Sequence[Group],
    closed: Mapping[str, Closed],
    limits: Mapping[str, tuple[float, float]],
    taken: list[str],
    notes: list[str],
) -> tuple[Part, ...]:
    """Parts with mesh, joint, shapes and what they are stated to weigh at state 0: every joint of the file at
    its closed position. The first of `groups` does not move."""
    ids: dict[str, int] = {}
    poses: dict[int | None, Array] = {None: np.eye(4)}
    placed: list[Part] = []
    for group in groups[1:]:
        first = group.first
        assert first is not None
        assert first.joint is not None
        given = first.joint.name in limits
        parent = _part_above(first, ids, source.bodies)
        mesh = _surfaces(group, notes)
        if not len(mesh.faces):
            raise InputError(
                f"{source.path}: body {first.name!r}, moved by joint {first.joint.name!r}, has no shape",
                "give it one, or leave it out with exclude",
            )
        span, asked = range_of(source, first.joint, limits), closed.get(first.joint.name)
        near, kept = around(groups, first), given and asked is not None
        travel = travel_of(source.path.name, span, asked, near, kept)
        notes += [travel.doubt] if travel.doubt else []
        T = poses[parent] @ first.joint.from_rest.pose(travel.closed - first.joint.rest)
        mesh = mesh.transformed(T)
        name = legal_name(first.name.partition("#")[0], taken)
        taken.append(name)
        part_id = FIRST_PART_ID + len(placed)
        ids[first.name], poses[part_id] = part_id, T
        part = Part(
            part_id,
            name,
            mesh,
            joint_of(first.joint, T, travel, mesh),
            Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0)),  # nobody moved it
            inertial=stated_inertial(source, group.bodies, T, notes),
            collision=tuple(moved(c, T) for c in _shapes(group)),
            parent=parent,
            limits_source=("given by the user" if given else f"stated in {source.path.name}")
            + (", cut off behind closed" if (travel.lower, travel.upper) != span else ""),
            closed_source=travel.source,
            type_source=f"stated in {source.path.name}",
        )
        placed.append(part)
    return tuple(placed)


def _part_above(body: SourceBody, ids: Mapping[str, int], bodies: Sequence[SourceBody]) -> int | None:
    """The part that a body is mounted on: the nearest one above it that moves."""
    above = {b.name: b.parent for b in bodies}
    name = body.parent
    while name is not None and name not in ids:
        name = above[name]
    return None if name is None else ids[name]
