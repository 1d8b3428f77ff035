"""Which measures a truth allows: what it has to know for each of them."""

from __future__ import annotations

from collections.abc import Iterable

from twin.errors import InputError, nearest_name

FACTS = {
    "cameras": "the cameras' poses, in the world in which the joints are told",
    "world": "the same by a reconstruction, which tells nothing of the cameras",
    "up": "that this world's z is up",
    "intervals": "when each part moves",
    "states": "each part's state in the frames",
    "closed end": "which end of a motion is closed",
    "centres": "where each part is",
    "fronts": "some of each part's surface",
    "meshes": "all of each part's surface",
    "static": "the surface of what never moves",
    "labels": "what each pixel shows",
    "hand": "the hand: its pixels, and where it holds a part",
    "all parts": "that no other part moves",
}
EVERYTHING = frozenset(FACTS)
_IMPLIED = {"cameras": "world", "meshes": "fronts"}

_MOTION = ("world", "states", "closed end", "fronts")
_SURFACE = ("world", "states", "meshes", "labels")
# By the names of the rows of an evaluation, in their order.
NEEDS: dict[str, tuple[str, ...]] = {
    "ATE": ("cameras",),
    "RPE": ("cameras",),
    "RPE, rotation": ("cameras",),
    "up": ("cameras", "up"),
    "frames with camera": ("cameras",),
    "hand mIoU": ("labels", "hand"),
    "hand on hand-free frames": ("labels", "hand"),
    "longest gap of labels": (),
    "static mesh accuracy": ("world", "labels", "static"),
    "static mesh completeness": ("world", "labels", "static"),
    "static Chamfer": ("world", "labels", "static"),
    "spurious parts": ("all parts",),
    "type right": (),
    "axis": ("world",),
    "pivot, line to line": ("world",),
    "pivot, point to line": ("world", "centres"),
    "state": ("states",),
    "range": ("states",),
    "screw path": _MOTION,
    "handle path": _MOTION,
    "opening direction right": _MOTION,
    "closed end right": ("states", "closed end"),
    "moving frames with state": ("states", "intervals"),
    "interval IoU": ("intervals",),
    "interval precision": ("intervals",),
    "interval recall": ("intervals",),
    "ADD": _MOTION,
    "ADD-S": _MOTION,
    "ADD AUC to 10 cm": _MOTION,
    "part mIoU": ("labels",),
    "part on frames without it": ("labels",),
    "part mesh accuracy": _SURFACE,
    "part mesh completeness": _SURFACE,
    "part Chamfer": _SURFACE,
    "contact": ("world", "states", "meshes", "hand"),
    "success": _MOTION,
    "success, 5 deg and 2 cm": (*_MOTION, "labels"),
}


def measurable(metric: str, known: frozenset[str]) -> bool:
    """Whether a truth that knows these facts allows a measure."""
    return with_implied(known).issuperset(NEEDS[metric])


def with_implied(known: frozenset[str]) -> frozenset[str]:
    """Facts with those that follow from them."""
    return known | {weaker for fact, weaker in _IMPLIED.items() if fact in known}


def unknown_measures(known: frozenset[str]) -> tuple[str, ...]:
    """The measures that a truth does not allow."""
    return tuple(m for m in NEEDS if not measurable(m, known))


def facts(names: Iterable[str], source: str) -> frozenset[str]:
    """Facts by their names. Raises InputError for another name."""
    found = frozenset(names)
    for name in sorted(found - EVERYTHING):
        near = nearest_name(name, list(FACTS))
        raise InputError(
            f"{source}: no truth knows {name!r}",
            (f"did you mean {near!r}? " if near else "") + f"known: {', '.join(FACTS)}",
        )
    return found
