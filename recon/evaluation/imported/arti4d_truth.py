"""Truth of an Arti4D scene: axes in the map, types, times of motion, and its odometry's cameras.

After the data set's loaders: <scene>.json holds {axis: {"position": [3], "axis": [3]}} in the map;
metadata.yaml, in the folder of the rooms, joint_types: {room: {scene: {axis: PRISMATIC or REVOLUTE}}};
matched_cues.csv when each axis was moved, as frames by the order of the images, of which rows with
VERIFICATION = VERIFIED hold. States, limits and masks are not annotated.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from recon.evaluation.imported.nested_yaml import nested_mapping
from recon.evaluation.known import facts
from recon.evaluation.metrics import Span
from recon.evaluation.truth import NOTHING, Truth, TruthPart, joint_of
from recon.readers import files
from recon.readers.arti4d import camera_poses, frame_times, read_table
from recon.readers.pictures import pictures
from twin.errors import InputError
from twin.scene import FIRST_PART_ID, Joint, Trajectory

KINDS = {"PRISMATIC": "prismatic", "REVOLUTE": "revolute"}
VERIFIED = "VERIFIED"
_AGAIN = "copy Arti4D's scene again"
_UP = 3  # folders above the scene in which metadata.yaml is looked for; chosen by us

Cues = dict[str, list[Span]]


def recognises(folder: Path) -> bool:
    """Whether a folder is an annotated scene of Arti4D."""
    return (folder / "matched_cues.csv").is_file() and (folder / "rgb").is_dir()


def arti4d_truth(folder: Path) -> Truth:
    """The truth of a scene. Raises InputError that names what is missing or garbled."""
    scene = folder.resolve().name
    times = frame_times(pictures(folder / "rgb", files.COLOR_SUFFIXES, "JPEG or PNG images"))
    cues, notes, whole = _cues(folder / "matched_cues.csv", len(times))
    annotated, kinds = folder / f"{scene}.json", _kinds(folder)
    if not annotated.is_file():
        raise InputError(f"{files.shown(folder)} has no {annotated.name} with the axes", _AGAIN)
    axes = files.read_json(annotated)
    parts = tuple(
        TruthPart(
            id=FIRST_PART_ID + k,
            name=name,
            joint=_joint(name, axes, kinds, annotated),
            states=np.zeros(0),
            T_world_part=np.zeros((0, 4, 4)),
            mesh=NOTHING,
            segments=tuple(spans),
            grip=None,
            told_spans=tuple(spans),
        )
        for k, (name, spans) in enumerate(cues.items())
    )
    cameras, said = _cameras(folder, times)
    known = [
        "intervals",
        *(["cameras"] if cameras else []),
        *(["all parts"] if whole else []),
    ]
    return Truth(
        folder=folder,
        frames=len(times),
        cameras=cameras,
        parts=parts,
        known=facts(known, files.shown(annotated)),
        name=scene,
        notes=(*notes, *said),
    )


def _cameras(folder: Path, times: np.ndarray[Any, Any]) -> tuple[Trajectory | None, tuple[str, ...]]:
    """Cameras in the map, and what is to be said when there are none: without them axes can't be compared."""
    found = camera_poses(folder)
    if found.poses is not None and found.in_map:
        tolerance = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        cameras = files.trajectory_at(*found.poses, times, tolerance)
        if cameras is not None:
            return cameras, found.warnings
    return None, (*found.warnings, f"{folder.name} tells no camera in its map, so axes can't be compared")


def _cues(path: Path, frames: int) -> tuple[Cues, list[str], bool]:
    """Moving frames of each axis, what was left out, and whether nothing was."""
    head, rows = read_table(path)
    names = ("axis_name", "cue_start", "cue_end", "verification")
    if missing := [n for n in names if n not in head]:
        raise InputError(
            f"{files.shown(path)} lacks {', '.join(missing).upper()}; its columns are {', '.join(head)}"[
                :200
            ],
            _AGAIN,
        )
    places = [head.index(n) for n in names]
    cues: Cues = {}
    notes: list[str] = []
    unverified = 0
    for k, row in enumerate(rows, 2):
        try:
            name, start, end, verified = (row[p] for p in places)
            first, last = int(start), int(end)
        except (IndexError, ValueError):
            raise InputError(f"{files.shown(path)} row {k} is {','.join(row)[:60]!r}", _AGAIN) from None
        if verified.upper() != VERIFIED:
            unverified += 1
        elif not 0 <= first < last < frames:
            why = "ends before it starts" if last <= first else f"is outside the {frames} frames"
            notes.append(f"{path.name} row {k}: {name} from {first} to {last} {why}, and is left out")
        else:
            cues.setdefault(name, []).append((first, last))
    if unverified:
        notes.append(f"{path.name}: {unverified} rows are not {VERIFIED}, and are left out")
    return {n: sorted(s) for n, s in cues.items()}, notes, not notes


def _kinds(folder: Path) -> Mapping[str, Any]:
    """Type of each axis of a scene."""
    resolved = folder.resolve()
    path = next((p for f in resolved.parents[:_UP] if (p := f / "metadata.yaml").is_file()), None)
    if path is None:
        raise InputError(
            f"{files.shown(folder)} has no metadata.yaml in the folders above, which tells the joints' types",
            "put Arti4D's raw/metadata.yaml beside the rooms",
        )
    kinds: Any = nested_mapping(path, "joint_types")
    for key in (resolved.parent.name, resolved.name):
        kinds = kinds.get(key)
        if not isinstance(kinds, dict):
            raise InputError(
                f"{files.shown(path)} tells no joint_types of {resolved.parent.name}/{resolved.name}",
                "copy it again",
            )
    return kinds


def _joint(name: str, axes: Mapping[str, Any], kinds: Mapping[str, Any], path: Path) -> Joint:
    kind = KINDS.get(str(kinds.get(name)).upper())
    if kind is None:
        raise InputError(
            f"metadata.yaml tells no joint type of {name}, but {kinds.get(name)!r}"[:200], _AGAIN
        )
    try:
        values = np.array([axes[name]["axis"], axes[name]["position"]], dtype=np.float64)
        if values.shape != (2, 3) or not np.all(np.isfinite(values)):
            raise ValueError(values.shape)
        return joint_of(kind, values[0], values[1], np.zeros(0))
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(f"{files.shown(path)} holds no axis and position of {name}", _AGAIN) from None
