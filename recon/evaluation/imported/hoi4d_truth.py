"""Truth of a HOI4D clip: joints by annotation, cameras (3Dseg/output.log), intervals (action/color.json).

After the data set's instructions and its users' loaders: objpose/<frame>.json lists, in the camera's frame,
each part with its label, `center` (m), `rotation` (rad: turn about x, then about the new y, then about the
new z) and `dimensions` length, width, height along the part's x, y, z. Hands are pickled there, and not read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from recon.evaluation.imported.joint_from_poses import MAX_RESIDUAL, FittedJoint, fit_joint
from recon.evaluation.known import facts
from recon.evaluation.metrics import Span, moving_span
from recon.evaluation.truth import NOTHING, Truth, TruthPart, joint_of
from recon.readers import files
from recon.readers.hoi4d import FPS, clip_folders, clip_name, read_redwood_log
from recon.readers.pictures import numbers, pictures
from recon.recording import MIN_FRAMES
from twin.errors import InputError
from twin.geometry import Array, exp_so3, make_pose
from twin.scene import FIRST_PART_ID, Trajectory

EVENTS = frozenset({"open", "close", "pull", "push"})  # events that move a joint
# of a part's travel, chosen by us: in an event that is the part's it moves at least so far
MIN_EVENT_SHARE = 0.1
MAX_SIZE = 10.0  # m, chosen by us: no part is larger, so a larger one is told in another unit
KNOWN = ("cameras", "intervals", "states", "centres")
_POSES = ("objpose_refined", "objpose")
_AGAIN = "copy HOI4D's annotations again"


def recognises(folder: Path) -> bool:
    """Whether a folder is a clip of HOI4D, or its annotations."""
    return any((folder / n).is_dir() for n in ("align_rgb", "align_depth", *_POSES))


def hoi4d_truth(folder: Path) -> Truth:
    """The truth of a clip; annotations lie in its folder or the data set's tree beside it.

    Raises InputError that names what is missing or garbled.
    """
    poses = _first(folder, _POSES)
    log = _first(folder, ("3Dseg/output.log",))
    if poses is None or log is None:
        lacking = (
            "objpose/ with the parts' poses" if poses is None else "3Dseg/output.log with the cameras' poses"
        )
        raise InputError(
            f"{folder} has no {lacking}, nor has HOI4D_annotations/ beside the data",
            "copy HOI4D's annotations of this clip into its folder",
        )
    T_world_cam = read_redwood_log(log)
    tracks, notes = _tracks(poses, T_world_cam), _unread(folder)
    events = _events(folder, len(T_world_cam))
    parts: list[TruthPart] = []
    whole = True
    for track in tracks:
        fitted = fit_joint(track.T_world_part, track.size) if len(track.frames) >= MIN_FRAMES else None
        if fitted is not None and fitted.residual > MAX_RESIDUAL:
            whole = False
            notes.append(
                f"{track.name}: its annotated poses are {100 * fitted.residual:.1f} cm (RMS) off the motion of any one joint; it is left out"
            )
        elif fitted is not None:
            parts.append(_part(FIRST_PART_ID + len(parts), track, fitted, len(T_world_cam), events))
    frames = np.arange(len(T_world_cam))
    return Truth(
        folder=folder,
        frames=len(frames),
        cameras=Trajectory(frames, frames / FPS, T_world_cam),
        parts=tuple(parts),
        known=facts((*KNOWN, *(["all parts"] if whole else [])), files.shown(poses)),
        name=clip_name(folder),
        notes=tuple(notes),
    )


@dataclass(frozen=True, eq=False)
class _Track:
    """An annotated part: frames (k,), T_world_part (k, 4, 4) of its box's middle, box size (3,) m."""

    name: str
    frames: Array
    T_world_part: Array
    size: Array


def _first(folder: Path, names: Sequence[str]) -> Path | None:
    return next((p for f in clip_folders(folder) for n in names if (p := f / n).exists()), None)


def _unread(folder: Path) -> list[str]:
    """What is there and not opened."""
    hands = next((p for f in clip_folders(folder) if f.is_dir() for p in sorted(f.glob("handpose*"))), None)
    if hands is None:
        return []
    return [f"{files.shown(hands)} holds pickles, which can run code: hands are not read"]


def _tracks(folder: Path, T_world_cam: Array) -> list[_Track]:
    """Parts by their label and, of one label, their order."""
    found: dict[tuple[str, int], list[tuple[int, Array, Array]]] = {}
    paths = pictures(folder, (".json",), "JSON files of poses")
    for path, frame in zip(paths, numbers(paths).tolist(), strict=True):
        if frame >= len(T_world_cam):
            raise InputError(
                f"{files.shown(path)} is of frame {frame}, 3Dseg/output.log has {len(T_world_cam)}", _AGAIN
            )
        seen: dict[str, int] = {}
        for label, T_cam_part, size in _entries(path):
            seen[label] = seen.get(label, 0) + 1
            found.setdefault((label, seen[label]), []).append((frame, T_world_cam[frame] @ T_cam_part, size))
    repeated = {label for label, k in found if k > 1}
    return [
        _Track(
            name=f"{label} {k}" if label in repeated else label,
            frames=np.array([f for f, _, _ in rows]),
            T_world_part=np.stack([T for _, T, _ in rows]),
            size=np.median([s for _, _, s in rows], axis=0),
        )
        for (label, k), rows in found.items()
    ]


def _entries(path: Path) -> Iterator[tuple[str, Array, Array]]:
    """Label, T_cam_part (4, 4) and size (3,) m of each part in one frame."""
    data = files.read_json(path)
    try:
        for entry in data["dataList"] if "dataList" in data else data["objects"]:
            centre, angles = _vector(entry["center"], "xyz"), _vector(entry["rotation"], "xyz")
            size = _vector(entry["dimensions"], ("length", "width", "height"))
            if not (
                np.all(size > 0) and np.all(size <= MAX_SIZE) and np.all(np.abs(centre) <= 10 * MAX_SIZE)
            ):
                raise ValueError("size")
            x, y, z = (exp_so3(a * e) for a, e in zip(angles, np.eye(3), strict=True))
            yield str(entry["label"]), make_pose(x @ y @ z, centre), size
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(
            f"{files.shown(path)} does not list parts with label, center, rotation and dimensions in m and rad",
            _AGAIN,
        ) from None


def _vector(value: Mapping[str, Any], keys: Sequence[str]) -> Array:
    vector = np.array([float(value[k]) for k in keys])
    if not np.all(np.isfinite(vector)):
        raise ValueError("not finite")
    return vector


def _events(folder: Path, frames: int) -> list[Span]:
    """First and last frame of every annotated event that moves a joint; none without annotated events."""
    path = _first(folder, ("action/color.json",))
    if path is None:
        return []
    data = files.read_json(path)
    try:
        info = data["info"]
        duration = float(info["duration"] if "duration" in info else info["Duration"])
        rate = frames / duration
        spans = []
        for event in data["events"] if "events" in data else data["markResult"]["marks"]:
            if str(event["event"]).strip().lower() in EVENTS:
                names = ("startTime", "endTime") if "startTime" in event else ("hdTimeStart", "hdTimeEnd")
                first, end = (int(float(event[n]) * rate) for n in names)
                spans.append((max(0, first), min(frames - 1, end - 1)))
    except (KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise InputError(f"{files.shown(path)} lists no events with their times", _AGAIN) from None
    return [(a, b) for a, b in spans if a < b]


def _part(key: int, track: _Track, fitted: FittedJoint, frames: int, events: Sequence[Span]) -> TruthPart:
    states = np.full(frames, np.nan)
    states[track.frames] = fitted.states
    T_world_part = np.full((frames, 4, 4), np.nan)
    T_world_part[track.frames] = track.T_world_part @ np.linalg.inv(track.T_world_part[0])
    travel = float(np.ptp(fitted.states))
    spans = tuple(e for e in events if _travelled(states, e) >= MIN_EVENT_SHARE * travel)
    if not spans and (found := moving_span(fitted.states)) is not None:
        spans = ((int(track.frames[found[0]]), int(track.frames[found[1]])),)
    return TruthPart(
        id=key,
        name=track.name,
        joint=joint_of(fitted.kind, fitted.axis, fitted.pivot, fitted.states),
        states=states,
        T_world_part=T_world_part,
        mesh=NOTHING,
        segments=spans,
        grip=None,
        centre=track.T_world_part[0, :3, 3],
        told_spans=spans,
    )


def _travelled(states: Array, span: Span) -> float:
    inside = states[span[0] : span[1] + 1]
    inside = inside[np.isfinite(inside)]
    return float(np.ptp(inside)) if len(inside) else 0.0
