"""Names of a furniture's parts: what kind of part it is and, where there are several of a kind, its place among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from twin import geometry as geo
from twin.completion.frame import PartFrame, kind_by_joint, part_frame
from twin.geometry import Array
from twin.names import legal_name
from twin.scene import Part

_ROWS = ("lower", "middle", "upper")
_COLUMNS = ("left", "middle", "right")
_UP = np.array([0.0, 0.0, 1.0])
# Share of the smaller extent by which the middles of two parts are apart that lie in different rows; chosen by us: those of one
# row differ by less than a tenth, those of stacked parts by all of it.
_APART = 0.5
_RAGGED = 0.02  # quantile of a mesh's points that is its edge; chosen by us: shreds of a scan are less


def part_names(
    parts: Sequence[Part],
    eye: Array | None = None,
    given: Mapping[int, str] | None = None,
    taken: Iterable[str] = (),
) -> dict[int, str]:
    """A name for every part id: `drawer`, of several `drawer_upper` and `drawer_lower`, `drawer_lower_left`; a namesake gets `_2`.

    Args:
        parts: at state 0; their own names are not asked.
        eye: where the viewer stood (3,), who tells left from right; by default before the fronts.
        given: names that parts have already and keep, by id.
        taken: names that no part may get.
    """
    frames = {p.id: part_frame(p, eye) for p in parts}
    kinds = {p.id: f.kind if (f := frames[p.id]) is not None else kind_by_joint(p.joint) for p in parts}
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


def _places(parts: Sequence[Part], right: Array) -> list[list[str]]:
    """Words for the place of each part among the others: its row, and its column in the row, where there are several."""
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
    out = np.sum([f.T_world_frame[:3, 2] for f in frames if f is not None], axis=0) * (1.0, 1.0, 0.0)
    if np.linalg.norm(out) < 0.3 and eye is not None:  # lids, which face upwards
        out = (eye - np.mean([p.mesh.area_centroid for p in parts], axis=0)) * (1.0, 1.0, 0.0)
    side = np.cross(_UP, out)
    return geo.unit(side) if np.linalg.norm(side) > 0.1 else np.array([1.0, 0.0, 0.0])
