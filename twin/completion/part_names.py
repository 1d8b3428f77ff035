"""Names of a furniture's parts: the kind of part and, if several are of a kind, its place among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from twin import geometry as geo
from twin.completion.frame import Kind, PartFrame, kind_by_joint, part_frame
from twin.geometry import Array
from twin.names import legal_name
from twin.scene import Part

_ROWS = ("lower", "middle", "upper")
_COLUMNS = ("left", "middle", "right")
_UP = np.array([0.0, 0.0, 1.0])
# Share of the smaller extent by which the middles of two parts are apart that lie in different rows; chosen
# by us: those of one row differ by less than a tenth, those of stacked parts by all of it.
_APART = 0.5
# Upward share of a unit normal above which a face is level; chosen by us: halfway between upright and level.
_LEVEL = 0.7
# Quantile of a mesh's points that is its edge; chosen by us: shreds of a scan are less.
_RAGGED = 0.02
# Length of a level direction below which it points nowhere; chosen by us: a face within 15 degrees of level.
_NOWHERE = 0.25


def part_names(
    parts: Sequence[Part],
    eye: Array | None = None,
    given: Mapping[int, str] | None = None,
    taken: Iterable[str] = (),
) -> dict[int, str]:
    """A name for every part id: `drawer`, or `drawer_upper`, `drawer_lower_left`; a namesake gets `_2`.

    Args:
        parts: at state 0; their own names are not asked.
        eye: where the viewer stood (3,), who tells left from right; by default before the fronts.
        given: names that parts have already and keep, by id.
        taken: names that no part may get.
    """
    frames = {p.id: part_frame(p, eye) for p in parts}
    kinds = {p.id: _kind(p, frames[p.id]) for p in parts}
    names = {k: name for k, name in (given or {}).items() if k in kinds}
    used = [*taken, *(given or {}).values()]
    for kind in dict.fromkeys(kinds.values()):
        alike = [p for p in parts if kinds[p.id] == kind]
        right = _right([frames[p.id] for p in alike], alike, eye)
        for part, place in zip(alike, _places(alike, right), strict=True):
            if part.id not in names:
                names[part.id] = legal_name("_".join([kind, *place]), used)
                used.append(names[part.id])
    return names


def _kind(part: Part, frame: PartFrame | None) -> Kind:
    """What the part is called: a slide along a face that looks up is a low drawer with a larger floor."""
    if frame is None or (frame.kind == "sliding_door" and abs(frame.T_world_frame[2, 2]) > _LEVEL):
        return kind_by_joint(part.joint)
    return frame.kind


def _places(parts: Sequence[Part], right: Array) -> list[list[str]]:
    """Words for the place of each part among the others: its row and column, where there are several."""
    places: list[list[str]] = [[] for _ in parts]
    rows = _groups([_span(p, _UP) for p in parts])
    for row, of_row in zip(_words(len(rows), _ROWS), rows, strict=True):
        columns = _groups([_span(parts[k], right) for k in of_row])
        for column, of_column in zip(_words(len(columns), _COLUMNS), columns, strict=True):
            for k in of_column:
                places[of_row[k]] = [word for word in (row, column) if word]
    return places


def _words(count: int, words: tuple[str, str, str]) -> list[str]:
    """One word for each of so many rows or columns; what is neither first nor last lies in the middle."""
    first, middle, last = words
    return [""] if count == 1 else [first, *[middle] * (count - 2), last]


def _groups(spans: Sequence[Array]) -> list[list[int]]:
    """Numbers of the spans (2,) that lie beside one another, from the lowest on."""
    middles = np.array([span.mean() for span in spans])
    order = [int(k) for k in np.argsort(middles, kind="stable")]
    groups = [[order[0]]]
    for before, here in pairwise(order):
        extent = min(float(np.ptp(spans[before])), float(np.ptp(spans[here])))
        if middles[here] - middles[before] > _APART * extent:
            groups.append([])
        groups[-1].append(here)
    return groups


def _span(part: Part, direction: Array) -> Array:
    """From where to where (2,) a part reaches along a direction."""
    points = part.mesh.vertices @ direction
    return np.quantile(points, [_RAGGED, 1 - _RAGGED]) if len(points) else np.zeros(2)


def _right(frames: Sequence[PartFrame | None], parts: Sequence[Part], eye: Array | None) -> Array:
    """Level unit direction (3,) to the right of who stands before the parts."""
    fronts = [np.zeros(3), *(f.T_world_frame[:3, 2] for f in frames if f is not None)]
    side = np.cross(_UP, np.sum(fronts, axis=0) / max(1, len(fronts) - 1))
    if np.linalg.norm(side) < _NOWHERE and eye is not None:  # lids, which face upwards, and what has no front
        side = np.cross(_UP, eye - np.mean([p.mesh.area_centroid for p in parts], axis=0))
    return geo.unit(side) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
