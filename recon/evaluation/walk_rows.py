"""The scores of a walk as rows and as a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from recon.evaluation.columns import aligned
from recon.evaluation.walk_scores import StateCounts, TruePartScore, WalkScores, share

COLUMNS = ("measure of the walk", "value", "matched only", "unit", "counted")
PART_COLUMNS = (
    "part",
    "found as",
    "fails by",
    "axis",
    "path",
    "mIoU",
    "interactions",
    "states",
    "not closed",
)


@dataclass(frozen=True)
class WalkRow:
    """One measure of a walk.

    value: failures charged; None where there is nothing to measure. matched: over the parts that are found,
    None where that is no other measure. counted: what the value is a share of, for people.
    """

    metric: str
    value: float | None
    matched: float | None = None
    unit: str = ""
    counted: str = ""

    @property
    def cells(self) -> tuple[str, ...]:
        """Texts under `COLUMNS`."""
        return self.metric, _number(self.value), _number(self.matched), self.unit, self.counted


def walk_rows(walk: WalkScores) -> tuple[WalkRow, ...]:
    """All measures of a walk, in the order of docs/metrics.md."""
    return (*_part_rows(walk), *_interval_rows(walk), *_state_rows(walk), *_camera_rows(walk))


def walk_table(walk: WalkScores) -> str:
    """Plain text: the measures, a line for each true part, one for each part of the twin that is none."""
    measures = aligned([COLUMNS, *(r.cells for r in walk_rows(walk))], right=(1, 2))
    parts = aligned([PART_COLUMNS, *(part_cells(p) for p in walk.parts)], right=(3, 4, 5, 6, 7, 8))
    return "\n".join([*measures, "", *parts, *remarks(walk)])


def summary(walk: WalkScores) -> dict[str, Any]:
    """JSON types: rows, true parts and found parts, without the single pairs of frames."""
    whole = walk.as_dict()
    return {"rows": [asdict(r) for r in walk_rows(walk)], "parts": whole["parts"], "found": whole["found"]}


def remarks(walk: WalkScores) -> list[str]:
    """A line for each part of the twin that no true part is found as."""
    return [
        f"{f.name}: {f.role}{f' of {f.of}' if f.of else ''}, {'trusted' if f.trusted else 'not trusted'}"
        for f in walk.found
        if f.role != "match"
    ]


def part_cells(part: TruePartScore) -> tuple[str, ...]:
    """Texts under `PART_COLUMNS`; deg and mm."""
    states, hits = part.states, part.intervals
    return (
        part.name,
        part.found or "-",
        part.cause or "",
        _number(part.axis_deg),
        _number(part.path_mm),
        _number(part.miou),
        f"{hits.hits} of {hits.true}",
        _number(share(states.right, states.frames)),
        _number(share(states.opened_right, states.opened)),
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _part_rows(walk: WalkScores) -> Iterator[WalkRow]:
    true, found, right = len(walk.parts), len(walk.matched), walk.right
    yield WalkRow("parts found", share(found, true), None, "share", f"{found} of {true}")
    matched = share(right, found) if found else None
    yield WalkRow("parts right", share(right, true), matched, "share", f"{right} of {true}")
    yield WalkRow("parts doubled", float(walk.count("double")))
    yield WalkRow("parts mis-solved", float(walk.count("mis-solved")))
    yield WalkRow("parts invented, trusted", float(walk.count("invented", True)))
    yield WalkRow("parts invented, not trusted", float(walk.count("invented", False)))
    yield WalkRow("room right", float(walk.room_right))


def _interval_rows(walk: WalkScores) -> Iterator[WalkRow]:
    every, found, some = walk.intervals, walk.intervals_matched, bool(walk.matched)
    for name, value, matched, counted in (
        ("precision", every.precision, found.precision if some else None, f"{every.hits} of {every.found}"),
        ("recall", every.recall, found.recall if some else None, f"{every.hits} of {every.true}"),
        ("F1", every.f1, found.f1 if some else None, f"{every.true} true, {every.found} found"),
    ):
        yield WalkRow(f"interaction {name}", value, matched, "share", counted)


def _state_rows(walk: WalkScores) -> Iterator[WalkRow]:
    every, found = walk.states, walk.states_matched

    def row(name: str, good: str, of: str) -> WalkRow:
        def rate(counts: StateCounts) -> float:
            return share(getattr(counts, good), getattr(counts, of))

        counted = f"{getattr(every, good)} of {getattr(every, of)} frames"
        return WalkRow(name, rate(every), rate(found) if walk.matched else None, "share", counted)

    yield row("states within 5 deg or 2 cm", "right", "frames")
    yield row("states within 5 deg or 2 cm, part not closed", "opened_right", "opened")
    yield row("states unknown", "unknown", "frames")
    yield row("states unknown, part not closed", "opened_unknown", "opened")


def _camera_rows(walk: WalkScores) -> Iterator[WalkRow]:
    pairs = f"{len(walk.local.mm)} of {walk.local.pairs} pairs"
    for q, name in ((0.5, "median"), (0.9, "p90")):
        mm, deg = walk.local.quantile(q) or (None, None)
        yield WalkRow(f"local camera error, {name}", mm, None, "mm", pairs)
        yield WalkRow(f"local camera rotation, {name}", deg, None, "deg", pairs)
    for piece in walk.pieces:
        name = "ATE" if len(walk.pieces) == 1 else f"ATE of the piece {piece.first}..{piece.last}"
        yield WalkRow(name, piece.ate_mm, None, "mm", f"{piece.frames} frames, {piece.way_m:.1f} m")
    poses = walk.poses
    for name, count in (
        ("frames with a pose", poses.posed),
        ("frames in a named gap", poses.named),
        ("frames with neither", poses.neither),
    ):
        yield WalkRow(name, share(count, poses.frames), None, "share", f"{count} of {poses.frames}")
