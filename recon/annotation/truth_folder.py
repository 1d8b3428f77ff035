"""Writes what was annotated as a truth (docs/recordings.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from recon.annotation.marks import Marks
from recon.annotation.seen import Seen, shown_in
from recon.annotation.solve import Annotated
from recon.recording.write import write_tum_poses
from twin.errors import InputError
from twin.files.atomic import contents, put, staging
from twin.files.ply import ply_bytes
from twin.files.text import write_json
from twin.scene import FIRST_PART_ID, STATIC_LABEL, Revolute

_OURS = re.compile(r"truth\.json|part_poses\.npz|trajectory\.txt|part_\d+\.ply|labels/\d{6,}\.png|labels")
_KNOWN = ("world", "intervals", "states", "closed end", "centres", "fronts", "labels")


def write_truth(folder: Path, seen: Seen, marks: Marks, parts: Sequence[Annotated]) -> Path:
    """Write the truth of these parts into a folder, in place of one that was annotated before.

    Raises InputError where a frame has no camera.
    """
    gaps = seen.cameras.gaps(len(seen.recording))
    if gaps:
        raise InputError(
            f"the cameras of frames {gaps[0][0]} to {gaps[0][1]} are not known",
            "cut the recording with --start and --end",
        )
    if not parts:
        raise InputError("nothing is annotated", "outline a part and mark its motion")
    rows = [_row(k, part) for k, part in enumerate(parts, FIRST_PART_ID)]
    with staging(folder) as place:
        (place / "labels").mkdir()
        write_json(
            place / "truth.json",
            {
                "frames": len(seen.recording),
                "known": [*_KNOWN, *(["all parts"] if marks.only else [])],
                "annotated": "by hand, in cameras that were reconstructed",
                "description": marks.description,
                "parts": rows,
            },
        )
        poses: dict[str, Any] = {
            f"part_{k}": p.joint.poses(p.states) for k, p in enumerate(parts, FIRST_PART_ID)
        }
        np.savez_compressed(place / "part_poses.npz", **poses)
        for row, part in zip(rows, parts, strict=True):
            (place / f"part_{row['id']}.ply").write_bytes(ply_bytes(part.surface))
        write_tum_poses(place / "trajectory.txt", seen.recording.times, seen.cameras.T_world_cam)
        _labels(place / "labels", seen, parts)
        before = contents(folder) if folder.is_dir() else []
        put(place, folder, [path for path in before if _OURS.fullmatch(path)])
    return folder


def _row(number: int, part: Annotated) -> dict[str, Any]:
    joint = part.joint
    moves = [[max(a - 1, 0), min(b + 1, len(part.states) - 1)] for a, b in part.marks.moves]
    return {
        "id": number,
        "name": part.marks.name,
        "type": joint.kind,
        "axis_world": joint.axis.tolist(),
        "pivot_world": joint.pivot.tolist() if isinstance(joint, Revolute) else None,
        "range": [joint.lower, joint.upper],
        "states": part.states.tolist(),
        "motion_segments": moves,
        "interval": [moves[0][0], moves[-1][1]],
    }


def _labels(folder: Path, seen: Seen, parts: Sequence[Annotated]) -> None:
    """A label image of every frame: the outlines where they were drawn, else what they show as the states
    move it, where nothing stands before it."""
    shape = seen.recording.intrinsics.height, seen.recording.intrinsics.width
    for frame in range(len(seen.recording)):
        image = np.full(shape, STATIC_LABEL, np.uint8)
        for k, part in enumerate(parts, FIRST_PART_ID):
            image[shown_in(seen, part.marks, part.surface, part.pose(frame), frame)] = k
        cv2.imwrite(str(folder / f"{frame:06d}.png"), image)
