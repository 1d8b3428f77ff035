"""Names, and the tree that joints build."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from twin.lint.model import WORLD, Fault, LintModel
from twin.names import is_legal_name


def cycle(model: LintModel) -> Iterator[Fault]:
    parents: dict[str, list[str]] = {}
    for j in model.joints:
        above = parents.setdefault(j.child, [])
        if (
            not j.loop
            and j.parent != j.child
            and j.child != WORLD
            and not (model.format == "mjcf" and above == [j.parent])
        ):
            above.append(j.parent)
    for name, above in parents.items():
        if len(above) > 1 and model.format == "urdf":
            yield Fault(
                "error",
                name,
                ", ".join(above),
                "it is the child of several joints",
                "keep one joint to a parent; close loops in the simulator",
            )
    color: dict[str, int] = {}
    for start in parents:
        path: list[str] = []
        here = start
        while here in parents and parents[here] and here not in color:
            color[here] = len(path)
            path.append(here)
            here = parents[here][0]
        if here in path:
            ring = path[path.index(here) :]
            remedy = "hang the chain on one root" + (
                ", or set physics:excludeFromArticulation on the joint that closes the loop"
                if model.format == "usd"
                else ""
            )
            yield Fault(
                "error",
                ring[0],
                " -> ".join([*ring[::-1], ring[-1]]),
                "these bodies carry each other in a circle",
                remedy,
            )


def roots(model: LintModel) -> Iterator[Fault]:
    if model.format != "urdf":
        return
    names = [b.name for b in model.bodies]
    children = {j.child for j in model.joints if not j.implied}
    top = [n for n in names if n not in children]
    if len(top) == 1 or any(j.parent not in names for j in model.joints if not j.implied):
        return  # a root that is not there is told by the joint that names it
    value = ", ".join(top) if top else "none"
    yield Fault(
        "error",
        "robot",
        value,
        "it has no root link" if not top else "it has several root links",
        "join all links into one tree",
    )


def duplicate(model: LintModel) -> Iterator[Fault]:
    counts = Counter((kind, name) for kind, name, _ in model.names)
    for (kind, name), n in counts.items():
        if n > 1 and name:
            where = [e for k, m, e in model.names if (k, m) == (kind, name)]
            yield Fault(
                "error",
                where[1],
                f"{n} times {name!r}",
                f"another {kind} has the same name ({where[0]})",
                "give each its own name",
            )


def illegal(model: LintModel) -> Iterator[Fault]:
    """One fault for all odd names of a kind: a model that uses other letters does so everywhere."""
    kinds = ("body", "link", "joint")
    for kind in kinds:
        for _, name, element in model.names:
            if _ == kind and not name and model.format == "urdf":
                yield Fault("error", element, "''", f"a {kind} has no name", "name it")
        odd = sorted(
            {n for k, n, _ in model.names if k == kind and n and n != WORLD and not is_legal_name(n)}
        )
        if odd:
            shown = ", ".join(repr(n) for n in odd[:3]) + (
                f" and {len(odd) - 3} more" if len(odd) > 3 else ""
            )
            yield Fault(
                "warning",
                kind,
                shown,
                f"names of {kind} elements that don't mean the same in every format",
                "use A-Z a-z 0-9 and _, a letter first",
            )
