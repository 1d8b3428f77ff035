"""Judge a twin by the truth of its recording: the table that `twin evaluate` prints (docs/metrics.md).

evaluation = evaluate(twin.load("RUN"), Path("RECORDING/truth"))
print(evaluation.table())
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from recon.evaluation.goals import Goal, goal_of
from recon.evaluation.metrics import Surface
from recon.evaluation.outcome import success
from recon.evaluation.scores import (
    CameraErrors,
    JointErrors,
    LabelScore,
    camera_errors,
    joint_errors,
    label_scores,
    match_parts,
)
from recon.evaluation.surface_scores import SAMPLES, SurfaceErrors, sampled, seen_points, surface_errors
from recon.evaluation.truth import Truth, TruthPart, load_truth
from recon.readers import open_recording
from recon.recording import Recording
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import HAND_LABEL, STATIC_LABEL, Part, Twin

__all__ = [
    "Evaluation", "Row", "camera_errors", "evaluate", "joint_errors", "label_scores", "load_truth", "match_parts",
]  # fmt: skip

SCENE = "scene"
ALL_PARTS = "all parts"

# What a missed part, a wrong type or an empty mesh is charged; a state and a range are charged the true travel.
CHARGE_AXIS_DEG = 90.0
CHARGE_DIRECTION_DEG = 180.0
CHARGE_LENGTH_MM = 1000.0


@dataclass(frozen=True)
class Row:
    """One measure of the scene or of one true part.

    value: failures charged. matched: the same without them, None for a failure. goal: the goal, None when only reported.
    """

    metric: str
    part: str
    value: float
    matched: float | None
    unit: str
    goal: Goal | None

    @property
    def ok(self) -> bool | None:
        """Whether the goal is met, None without one."""
        return None if self.goal is None else self.goal.met(self.value)

    def as_dict(self) -> dict[str, Any]:
        return {
            "metric": self.metric,
            "part": self.part,
            "value": self.value,
            "matched": self.matched,
            "unit": self.unit,
            "goal": None if self.goal is None else str(self.goal),
            "ok": self.ok,
        }


@dataclass(frozen=True)
class Evaluation:
    """All rows of one twin against one truth, with the data set's name."""

    name: str
    rows: tuple[Row, ...]

    @property
    def ok(self) -> bool:
        """Whether every goal is met."""
        return all(r.ok is not False for r in self.rows)

    def row(self, metric: str, part: str | None = None) -> Row:
        """The row of a measure (and part). Raises KeyError when there is none."""
        for r in self.rows:
            if r.metric == metric and part in (None, r.part):
                return r
        raise KeyError(f"no row {metric!r} of {part!r}")

    def as_dict(self) -> dict[str, Any]:
        """JSON types only."""
        return {"recording": self.name, "ok": self.ok, "rows": [r.as_dict() for r in self.rows]}

    def table(self) -> str:
        """Plain text, one line a row."""
        head = ("measure", "of", "value", "matched only", "unit", "goal", "")
        verdict = {None: "", True: "met", False: "MISSED"}
        body = [
            (
                r.metric,
                r.part,
                f"{r.value:.4g}",
                "-" if r.matched is None else f"{r.matched:.4g}",
                r.unit,
                "" if r.goal is None else str(r.goal),
                verdict[r.ok],
            )
            for r in self.rows
        ]
        widths = [max(len(line[k]) for line in (head, *body)) for k in range(len(head))]
        lines = [
            "  ".join(
                w.rjust(n) if k in (2, 3) else w.ljust(n)
                for k, (w, n) in enumerate(zip(line, widths, strict=True))
            )
            for line in (head, *body)
        ]
        missed = sum(r.ok is False for r in self.rows)
        goals = sum(r.ok is not None for r in self.rows)
        end = f"{self.name}: {goals - missed} of {goals} goals met"
        return "\n".join([*(line.rstrip() for line in lines), end])


def evaluate(twin: Twin, truth: Path | str | Truth, recording: Recording | None = None) -> Evaluation:
    """Judge a twin by a truth folder.

    Args:
        truth: folder truth/ or what `load_truth` made of it.
        recording: what the twin was made from; by default the folder around the truth.

    Raises:
        InputError: the truth can't be read or is of another recording, or the twin has no cameras.
    """
    true = truth if isinstance(truth, Truth) else load_truth(truth)
    recording = recording or open_recording(true.folder.parent)
    if twin.cameras is None:
        raise InputError(f"twin {twin.name} has no cameras to align the worlds by", "reconstruct it again")
    if len(recording) != true.frames:
        raise InputError(
            f"{recording.source} has {len(recording)} frames, {true.folder} has {true.frames}",
            "give the truth of this recording",
        )
    cameras = camera_errors(twin.cameras, true)
    T = cameras.T_truth_recon
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, true)
    matched = {true.parts[i].id: twin.parts[j] for i, j in pairs.items()}
    labels: dict[int, LabelScore] = {}  # empty when the twin has no labels at all, which is charged
    if twin.labels:
        labels = label_scores(twin.labels, true, {k: p.id for k, p in matched.items()})
    seen = seen_points(recording, true)
    rows = list(_camera_rows(cameras))
    rows += _scene_rows(twin, true, labels.get(HAND_LABEL), seen, T)
    rows.append(_row("spurious parts", SCENE, float(len(twin.parts) - len(matched)), 0.0))
    per_part = [
        list(_part_rows(matched.get(p.id), p, true, labels.get(p.id), seen[p.id], T)) for p in true.parts
    ]
    rows += [r for part in per_part for r in part]
    if len(per_part) > 1:
        rows += _mean_rows(per_part)
    return Evaluation(recording.name, tuple(rows))


def _row(metric: str, part: str, value: float | None, charge: float, unit: str = "") -> Row:
    """A row whose value is `charge` when there is none."""
    charged = charge if value is None else value
    return Row(
        metric, part, float(charged), None if value is None else float(value), unit, goal_of(metric, unit)
    )


def _camera_rows(cameras: CameraErrors) -> Iterator[Row]:
    yield _row("ATE", SCENE, cameras.ate_mm, CHARGE_LENGTH_MM, "mm")
    yield _row("RPE", SCENE, cameras.rpe_mm, CHARGE_LENGTH_MM, "mm")
    yield _row("RPE, rotation", SCENE, cameras.rpe_deg, CHARGE_DIRECTION_DEG, "deg")
    yield _row("up", SCENE, cameras.up_deg, CHARGE_DIRECTION_DEG, "deg")
    yield _row("frames with camera", SCENE, cameras.share, 0.0, "share")


def _scene_rows(
    twin: Twin, truth: Truth, hand: LabelScore | None, seen: dict[int, Array], T: Array
) -> Iterator[Row]:
    yield from _label_rows("hand mIoU", "hand on hand-free frames", SCENE, hand)
    labelled = np.array([-1, *sorted(f for f in twin.labels if f < truth.frames), truth.frames])
    yield _row("longest gap of labels", SCENE, float(np.diff(labelled).max()), 0.0, "frames")
    points = seen[STATIC_LABEL]
    on_surface = Surface(truth.static).nearest(points[:: max(1, len(points) // SAMPLES)])
    static = surface_errors(twin.static.mesh.transformed(T), truth.static, points, on_surface)
    yield from _surface_rows("static", SCENE, static)


def _label_rows(miou: str, false: str, part: str, score: LabelScore | None) -> Iterator[Row]:
    """Rows of a mask; what no labelled frame can tell is left out, and a twin without labels (None) is charged."""
    if score is None or score.frames:
        yield _row(miou, part, score.miou if score else None, 0.0, "share")
    if score is None or score.other_frames:
        yield _row(false, part, score.false_share if score else None, 1.0, "share")


def _surface_rows(what: str, part: str, errors: SurfaceErrors | None) -> Iterator[Row]:
    e = errors
    yield _row(f"{what} mesh accuracy", part, e.accuracy_mm if e else None, CHARGE_LENGTH_MM, "mm")
    yield _row(f"{what} mesh completeness", part, e.completeness if e else None, 0.0, "share")
    yield _row(f"{what} Chamfer", part, e.chamfer_cm if e else None, CHARGE_LENGTH_MM / 10, "cm")


def _part_rows(
    found: Part | None, true: TruthPart, truth: Truth, labels: LabelScore | None, seen: Array, T: Array
) -> Iterator[Row]:
    joint = joint_errors(found.joint, found.motion, T, truth, true) if found else None
    yield from _joint_rows(joint, true)
    yield from _label_rows("part mIoU", "part on frames without it", true.name, labels)
    mesh = true.closed_mesh
    surface = surface_errors(found.mesh.transformed(T), mesh, seen, sampled(mesh)) if found else None
    yield from _surface_rows("part", true.name, surface)
    if true.grip is not None:
        yield _row("contact", true.name, _contact_mm(found, true, T), CHARGE_LENGTH_MM, "mm")
    yield _row("success", true.name, float(joint.success) if joint else None, 0.0)
    strict = success(joint, labels.miou if labels else None)
    yield _row("success, 5 deg and 2 cm", true.name, float(strict) if joint else None, 0.0)


def _joint_rows(joint: JointErrors | None, true: TruthPart) -> Iterator[Row]:
    e, name = joint, true.name
    revolute = true.joint.kind == "revolute"
    unit = "deg" if revolute else "mm"
    travel = float(np.degrees(true.travel)) if revolute else 1e3 * true.travel
    yield _row("type right", name, float(e.type_right) if e else None, 0.0)
    yield _row("axis", name, e.axis_deg if e else None, CHARGE_AXIS_DEG, "deg")
    if revolute:
        yield _row("pivot, line to line", name, e.pivot_line_mm if e else None, CHARGE_LENGTH_MM, "mm")
        yield _row("pivot, point to line", name, e.pivot_mm if e else None, CHARGE_LENGTH_MM, "mm")
    yield _row("state", name, e.state if e else None, travel, unit)
    yield _row("range", name, e.range if e else None, travel, unit)
    yield _row("screw path", name, e.screw_path_deg if e else None, CHARGE_DIRECTION_DEG, "deg")
    yield _row("handle path", name, e.handle_rmse_mm if e else None, CHARGE_LENGTH_MM, "mm")
    yield _row("opening direction right", name, float(e.opening_right) if e else None, 0.0)
    yield _row("closed end right", name, float(e.closed_right) if e else None, 0.0)
    yield _row("moving frames with state", name, e.state_share if e else None, 0.0, "share")
    yield _row("interval IoU", name, e.interval_iou if e else None, 0.0)
    yield _row("interval precision", name, e.interval_precision if e else None, 0.0)
    yield _row("interval recall", name, e.interval_recall if e else None, 0.0)
    yield _row("ADD", name, e.add if e else None, 0.0, "share")
    yield _row("ADD-S", name, e.add_s if e else None, 0.0, "share")
    yield _row("ADD AUC to 10 cm", name, e.auc if e else None, 0.0, "share")


def _contact_mm(found: Part | None, true: TruthPart, T: Array) -> float | None:
    """How much further from the centre of the grip the contact point is than the true surface, at the closed state."""
    if found is None or found.contact is None or true.grip is None:
        return None
    grip = true.handle
    distance = float(np.linalg.norm(geo.transform(T, found.contact.point[None])[0] - grip))
    return 1e3 * max(0.0, distance - float(Surface(true.closed_mesh).distance(grip[None])[0]))


def _mean_rows(per_part: Sequence[Sequence[Row]]) -> list[Row]:
    """Means over parts of every measure and unit, with failures charged and over the matched ones only."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for r in (r for rows in per_part for r in rows):
        groups.setdefault((r.metric, r.unit), []).append(r)
    out = []
    for (metric, unit), rows in groups.items():
        matched = [r.matched for r in rows if r.matched is not None]
        mean = float(np.mean(matched)) if matched else None
        out.append(Row(metric, ALL_PARTS, float(np.mean([r.value for r in rows])), mean, unit, None))
    return out
