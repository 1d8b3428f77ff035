"""Reads the truth of a recording: a simulated recording's own folder, or what others annotated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from recon.evaluation.imported import imported_truth
from recon.evaluation.known import EVERYTHING, facts
from recon.evaluation.truth import NOTHING, Truth, TruthPart, joint_of
from recon.readers import files
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.errors import FuntwinError, InputError
from twin.files.ply import read_ply
from twin.geometry import Array
from twin.scene import Trajectory
from twin.storage.labels import LabelFolder

_AGAIN = "write it anew with the simulator"


def load_truth(folder: Path | str) -> Truth:
    """Read a folder truth/, or a HOI4D or Arti4D clip's annotations. InputError names file and value."""
    folder = Path(folder)
    own = next((f for f in (folder, folder / "truth") if (f / "truth.json").is_file()), None)
    if own is not None:
        return _own_truth(own)
    found = imported_truth(folder)
    if found is None:
        raise InputError(
            f"{folder} holds no truth.json",
            "give the folder truth/ of a simulated recording, or an annotated clip of HOI4D or Arti4D",
        )
    return found


def _own_truth(folder: Path) -> Truth:
    """Read a folder truth/; `known` in its truth.json says what is there when that is not everything."""
    data = files.read_json(folder / "truth.json")
    shown = files.shown(folder / "truth.json")
    try:
        frames = int(data["frames"])
        known = facts(data["known"], shown) if "known" in data else EVERYTHING
        ids = [int(p["id"]) for p in data["parts"]]
        whole = "states" in known
        poses = _part_poses(folder, ids, frames) if whole else dict.fromkeys(ids, np.zeros((0, 4, 4)))
        hand = (data.get("hand") or {}) if whole and "hand" in known else {}
        parts = tuple(_part(folder, p, hand, poses[int(p["id"])], known) for p in data["parts"])
    except FuntwinError:
        raise
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{shown} lacks or garbles {error}", _AGAIN) from None
    return Truth(
        folder=folder,
        frames=frames,
        cameras=_cameras(folder, frames) if known & {"cameras", "world"} else None,
        parts=parts,
        labels=LabelFolder(folder / "labels") if "labels" in known else {},
        static=read_ply(folder / "static.ply") if "static" in known else NOTHING,
        intrinsics=_intrinsics(folder / "intrinsic.json"),
        known=known,
    )


def _cameras(folder: Path, frames: int) -> Trajectory:
    stamps, cameras = files.read_tum_poses(folder / "trajectory.txt")
    if len(cameras) != frames:
        raise InputError(
            f"{files.shown(folder / 'trajectory.txt')} has {len(cameras)} poses for {frames} frames",
            "the truth has one pose a frame",
        )
    return Trajectory(np.arange(frames), stamps, cameras)


def _intrinsics(path: Path) -> Intrinsics | None:
    return files.read_intrinsics(path) if path.is_file() else None


def _part_poses(folder: Path, ids: list[int], frames: int) -> dict[int, Array]:
    path = folder / "part_poses.npz"
    try:
        with np.load(path, allow_pickle=False) as archive:
            poses = {k: np.asarray(archive[f"part_{k}"], dtype=np.float64) for k in ids}
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{files.shown(path)} can't be read ({error})", _AGAIN) from None
    for k, T in poses.items():
        if T.shape != (frames, 4, 4):
            raise InputError(
                f"{files.shown(path)}: part_{k} has shape {T.shape}", f"expected ({frames}, 4, 4)"
            )
    return poses


def _part(
    folder: Path,
    entry: Mapping[str, Any],
    hand: Mapping[str, Any],
    T_world_part: Array,
    known: frozenset[str],
) -> TruthPart:
    states = np.array(entry["states"] if "states" in known else [], dtype=np.float64)
    if states.shape != (len(T_world_part),):
        raise InputError(
            f"{files.shown(folder / 'truth.json')} has {states.size} states of part {entry['id']} for "
            f"{len(T_world_part)} frames",
            "the truth has one state a frame",
        )
    segments = entry.get("motion_segments") or ([entry["interval"]] if entry.get("interval") else [])
    spans = tuple((int(a), int(b)) for a, b in segments)
    return TruthPart(
        id=int(entry["id"]),
        name=str(entry["name"]),
        joint=joint_of(entry["type"], entry["axis_world"], entry.get("pivot_world"), states),
        states=states,
        T_world_part=T_world_part,
        mesh=read_ply(folder / f"part_{int(entry['id'])}.ply") if known & {"meshes", "fronts"} else NOTHING,
        segments=spans,
        grip=_grip(int(entry["id"]), hand, T_world_part),
        # without states, a motion lies between the frames at rest around it
        told_spans=None if "states" in known else tuple((a + 1, b - 1) for a, b in spans if b - a > 2),
    )


def _grip(part: int, hand: Mapping[str, Any], T_world_part: Array) -> Array | None:
    """Median grip centre (3,) in the world at state 0, over the frames in which the hand holds the part."""
    points = hand.get("contact_point_world") or []
    owners = hand.get("contact_part") or [None] * len(points)
    held = [
        geo.transform(geo.invert_pose(T_world_part[k]), np.array([p], dtype=np.float64))[0]
        for k, (p, owner) in enumerate(zip(points, owners, strict=True))
        if p is not None and owner == part
    ]
    return np.median(held, axis=0) if held else None
