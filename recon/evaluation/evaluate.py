"""Judge a twin by the truth of its recording: the table that `twin evaluate` prints (docs/metrics.md).

evaluation = evaluate(twin.load("RUN"), Path("RECORDING/truth"))
print(evaluation.table())
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from recon.evaluation.cut_truth import truth_of
from recon.evaluation.goals import goal_of
from recon.evaluation.known import measurable, unknown_measures
from recon.evaluation.metrics import DistanceField
from recon.evaluation.outcome import success
from recon.evaluation.read_truth import load_truth
from recon.evaluation.rows import Evaluation, Row
from recon.evaluation.scores import (
    CameraErrors,
    JointErrors,
    LabelScore,
    camera_errors,
    contact_mm,
    joint_errors,
    label_scores,
    match_parts,
)
from recon.evaluation.surface_scores import SAMPLES, SurfaceErrors, sampled, seen_points, surface_errors
from recon.evaluation.truth import Truth, TruthPart
from recon.evaluation.walks import is_walk, lacking, walk_scores
from recon.readers import open_recording
from recon.recording import Recording
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import HAND_LABEL, STATIC_LABEL, Part, Twin

__all__ = [
    "Evaluation", "Row", "camera_errors", "evaluate", "joint_errors", "label_scores", "load_truth", "match_parts",
]  # fmt: skip

SCENE = "scene"
ALL_PARTS = "all parts"

# What a missed part, a wrong type or an empty mesh is charged; states and ranges are charged the true travel.
CHARGE_AXIS_DEG = 90.0
CHARGE_DIRECTION_DEG = 180.0
CHARGE_LENGTH_MM = 1000.0


def evaluate(twin: Twin, truth: Path | str | Truth, recording: Recording | None = None) -> Evaluation:
    """Judge a twin by a truth, in the measures that it allows.

    Args:
        truth: folder truth/, an annotated clip of HOI4D or Arti4D, or what `load_truth` made of it.
        recording: what the twin was made from, all of it or some of its frames; by default the folder around
            a simulated recording's truth.

    Raises:
        InputError: the truth can't be read or is of another recording, or the twin has no cameras.
    """
    true = truth if isinstance(truth, Truth) else load_truth(truth)
    if recording is None and true.tells_surfaces:
        recording = open_recording(true.folder.parent)
    if recording is not None:
        true = truth_of(true, recording)
    if twin.cameras is None and true.cameras is not None:
        raise InputError(f"twin {twin.name} has no cameras to align the worlds by", "reconstruct it again")
    _require_frames(twin, true, recording)
    cameras = None
    if twin.cameras is not None and true.cameras is not None:
        cameras = camera_errors(twin.cameras, true)
    T = np.eye(4) if cameras is None else cameras.T_truth_recon
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, true)
    matched = {true.parts[i].id: twin.parts[j] for i, j in pairs.items()}
    labels: dict[int, LabelScore] = {}  # empty when the twin has no labels at all, which is charged
    if twin.labels and true.knows("labels"):
        labels = label_scores(twin.labels, true, {k: p.id for k, p in matched.items()})
    seen: dict[int, Array] = {}
    if recording is not None and true.cameras is not None and true.knows("states") and true.tells_surfaces:
        seen = seen_points(recording, true)
    rows = [] if cameras is None else list(_camera_rows(cameras))
    rows += _scene_rows(twin, true, labels.get(HAND_LABEL), seen, T)
    rows.append(_row("spurious parts", SCENE, float(len(twin.parts) - len(matched)), 0.0))
    rows = _allowed(rows, true)
    per_part = [
        _allowed(_part_rows(matched.get(p.id), p, true, labels.get(p.id), seen.get(p.id), T), true)
        for p in true.parts
    ]
    rows += [r for part in per_part for r in part]
    if len(per_part) > 1:
        rows += _mean_rows(per_part)
    name = true.name or (recording.name if recording else true.folder.resolve().name)
    known = {(k, p.id): labels[k] for k, p in matched.items() if k in labels}
    lacks = lacking(true) if is_walk(true) else ()
    gaps = twin.cameras.gaps(true.frames) if twin.cameras is not None else ()  # a warning names them all
    walk = walk_scores(twin, true, gaps=gaps, labels=known) if is_walk(true) and not lacks else None
    stands_for = {p.name: matched[p.id].name for p in true.parts if p.id in matched}
    return Evaluation(name, tuple(rows), unknown_measures(true.known), true.notes, walk, lacks, stands_for)


def _allowed(rows: Iterable[Row], true: Truth) -> list[Row]:
    """The rows whose measure the truth allows."""
    return [r for r in rows if measurable(r.metric, true.known)]


def _require_frames(twin: Twin, true: Truth, recording: Recording | None) -> None:
    """Raise InputError when truth and recording, or twin, differ in their number of frames."""
    source, frames = (
        (twin.name, true.frames) if twin.recorded is None else (twin.recorded.source, twin.recorded.frames)
    )
    if recording is not None:
        source, frames = recording.source, len(recording)
    if frames != true.frames:
        raise InputError(
            f"{source} has {frames} frames, {true.folder} has {true.frames}",
            "give the truth of this recording",
        )


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
    points = seen.get(STATIC_LABEL)
    if points is None:
        return
    on_surface = DistanceField(truth.static).nearest(points[:: max(1, len(points) // SAMPLES)])
    static = surface_errors(twin.static.mesh.transformed(T), truth.static, points, on_surface)
    yield from _surface_rows("static", SCENE, static)


def _label_rows(miou: str, false: str, part: str, score: LabelScore | None) -> Iterator[Row]:
    """Rows of a mask; what no labelled frame shows is left out, a twin without labels (None) charged."""
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
    found: Part | None, true: TruthPart, truth: Truth, labels: LabelScore | None, seen: Array | None, T: Array
) -> Iterator[Row]:
    joint = joint_errors(found.joint, found.motion, T, truth, true) if found else None
    yield from _joint_rows(joint, true)
    yield from _label_rows("part mIoU", "part on frames without it", true.name, labels)
    mesh, surface = true.closed_mesh, None
    if found and seen is not None and len(mesh.faces):
        surface = surface_errors(found.mesh.transformed(T), mesh, seen, sampled(mesh))
    yield from _surface_rows("part", true.name, surface)
    if true.grip is not None:
        yield _row("contact", true.name, contact_mm(found, true, T), CHARGE_LENGTH_MM, "mm")
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
    yield _row("opening direction right", name, e.opening_right if e else None, 0.0)
    yield _row("closed end right", name, e.closed_right if e else None, 0.0)
    yield _row("moving frames with state", name, e.state_share if e else None, 0.0, "share")
    yield _row("interval IoU", name, e.interval_iou if e else None, 0.0)
    yield _row("interval precision", name, e.interval_precision if e else None, 0.0)
    yield _row("interval recall", name, e.interval_recall if e else None, 0.0)
    yield _row("ADD", name, e.add if e else None, 0.0, "share")
    yield _row("ADD-S", name, e.add_s if e else None, 0.0, "share")
    yield _row("ADD AUC to 10 cm", name, e.auc if e else None, 0.0, "share")


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
