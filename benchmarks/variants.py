"""Cut or reverse a recording together with its truth: backwards, every second frame, or trimmed to a visible
hand.

    python benchmarks/variants.py RECORDING OUT --kind reversed half hand-first hand-last

writes OUT/<name>_<kind> for every kind, in the native layout.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.readers import files, open_recording
from recon.recording import Recording
from twin.errors import FuntwinError, InputError
from twin.geometry import Array, quat_wxyz_from_matrix
from twin.scene import HAND_LABEL

HAND_SHARE = 0.01  # of the pixels, chosen by us: a hand that is plainly in the picture
REST_FRAMES = 2  # frames that stay before or after the motion in a trimmed clip, chosen by us
_HAND_LISTS = ("contact", "contact_part", "contact_point_world")


def _hand_frames(truth: Truth) -> list[int]:
    shown = [f for f in truth.labels if np.mean(truth.labels[f] == HAND_LABEL) >= HAND_SHARE]
    if not shown:
        raise InputError(f"{truth.folder} shows no hand", "this kind needs one")
    return sorted(shown)


def _motion(truth: Truth) -> tuple[int, int]:
    spans = [p.span for p in truth.parts if p.span is not None]
    if not spans:
        raise InputError(f"{truth.folder} has no moving part", "this kind needs one")
    return min(a for a, _ in spans), max(b for _, b in spans)


def _from_hand(truth: Truth) -> range:
    first = max(0, min(_hand_frames(truth)[0], _motion(truth)[0] - REST_FRAMES))
    return range(first, truth.frames)


def _to_hand(truth: Truth) -> range:
    last = min(truth.frames - 1, max(_hand_frames(truth)[-1], _motion(truth)[1] + REST_FRAMES))
    return range(last + 1)


KINDS: dict[str, Callable[[Truth], Sequence[int]]] = {
    "reversed": lambda truth: range(truth.frames - 1, -1, -1),
    "half": lambda truth: range(0, truth.frames, 2),
    "hand-first": _from_hand,
    "hand-last": _to_hand,
    "hand-both": lambda truth: range(_from_hand(truth).start, _to_hand(truth).stop),
}


def write_variant(source: Path, target: Path, kind: str) -> Path:
    """Write one kind of variant of a native recording with truth/ into a new folder and return that folder.

    Raises InputError for an unknown kind, an unreadable source, or a target that exists.
    """
    if kind not in KINDS:
        raise InputError(f"there is no kind {kind!r} of variant", f"use one of {', '.join(KINDS)}")
    recording, truth = open_recording(source, "native"), load_truth(source)
    return write_frames(source, target, recording, truth, list(KINDS[kind](truth)))


def write_frames(
    source: Path, target: Path, recording: Recording, truth: Truth, frames: Sequence[int]
) -> Path:
    """Write the recording that shows `frames` (each next one later, or each next one earlier) of another
    one."""
    steps = np.sign(np.diff(frames))
    if len(frames) < 2 or np.any(steps != steps[0]) or steps[0] == 0:
        raise InputError(f"frames {list(frames)[:5]} do not run one way", "give rising or falling numbers")
    if target.exists():
        raise InputError(f"{target} exists", "name a new folder")
    target.mkdir(parents=True)
    _copy_images(source, target, frames)
    times = _times(recording.times, frames)
    (target / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in times))
    for name in ("intrinsic.json", "depth_intrinsic.json"):
        if (source / name).is_file():
            shutil.copyfile(source / name, target / name)
    if recording.poses is not None:
        known = [(t, recording.poses.pose(f)) for t, f in zip(times, frames, strict=True)]
        _write_poses(target / "trajectory.txt", [(t, T) for t, T in known if T is not None])
    _write_metadata(source, target, recording, truth, frames[0])
    _write_truth(truth, target / "truth", frames, times)
    return target


def _copy_images(source: Path, target: Path, frames: Sequence[int]) -> None:
    color = next(source / n for n in ("color", "rgb", "image") if (source / n).is_dir())
    for folder, name in ((color, "color"), (source / "depth", "depth")):
        (target / name).mkdir()
        images = sorted(
            (p for p in folder.iterdir() if p.suffix.lower() in files.COLOR_SUFFIXES), key=files.natural_key
        )
        for k, frame in enumerate(frames):
            shutil.copyfile(images[frame], target / name / f"{k:06d}{images[frame].suffix}")


def _times(times: Array, frames: Sequence[int]) -> Array:
    """Times of the new frames: the same pauses between them, starting with the old recording's first time or
    later."""
    chosen = times[list(frames)]
    return np.asarray(chosen if chosen[-1] > chosen[0] else times[0] + (chosen[0] - chosen))


def _write_poses(path: Path, poses: Sequence[tuple[float, Array]]) -> None:
    lines = ["# timestamp tx ty tz qx qy qz qw   (camera to world, OpenCV camera axes, metres)"]
    for t, T in poses:
        w, x, y, z = quat_wxyz_from_matrix(T[:3, :3])
        lines.append(f"{t:.6f} " + " ".join(f"{v:.9f}" for v in (*T[:3, 3], x, y, z, w)))
    path.write_text("\n".join(lines) + "\n")


def _write_metadata(source: Path, target: Path, recording: Recording, truth: Truth, first: int) -> None:
    """metadata.json with gravity turned into the axes of the new first camera."""
    if not (source / "metadata.json").is_file():
        return
    data = files.read_json(source / "metadata.json")
    if recording.gravity_camera0 is not None:
        old, new = truth.cameras.T_world_cam[0, :3, :3], truth.cameras.T_world_cam[first, :3, :3]
        data["gravity_camera0"] = (new.T @ old @ recording.gravity_camera0).tolist()
    (target / "metadata.json").write_text(json.dumps(data, indent=1) + "\n")


def _write_truth(truth: Truth, target: Path, frames: Sequence[int], times: Array) -> None:
    (target / "labels").mkdir(parents=True)
    for k, frame in enumerate(frames):
        shutil.copyfile(truth.folder / "labels" / f"{frame:06d}.png", target / "labels" / f"{k:06d}.png")
    for mesh in truth.folder.glob("*.ply"):
        shutil.copyfile(mesh, target / mesh.name)
    for archive in truth.folder.glob("*.npz"):
        with np.load(archive, allow_pickle=False) as old:
            np.savez_compressed(target / archive.name, **{k: old[k][list(frames)] for k in old.files})
    cameras = truth.cameras.T_world_cam
    _write_poses(
        target / "trajectory.txt", [(float(t), cameras[f]) for t, f in zip(times, frames, strict=True)]
    )
    data = files.read_json(truth.folder / "truth.json")
    data["frames"] = len(frames)
    data["fps"] = round(1.0 / float(np.median(np.diff(times))), 6)
    data["parts"] = [_part(part, frames) for part in data["parts"]]
    hand = data.get("hand") or {}
    data["hand"] = {k: [v[f] for f in frames] if k in _HAND_LISTS else v for k, v in hand.items()}
    (target / "truth.json").write_text(json.dumps(data, indent=1) + "\n")


def _part(part: Mapping[str, Any], frames: Sequence[int]) -> dict[str, Any]:
    """A part's entry with states and motion segments of the new frames; state 0 stays the closed one."""
    states = [part["states"][f] for f in frames]
    old = part.get("motion_segments") or ([part["interval"]] if part.get("interval") else [])
    segments = [s for s in (_segment(a, b, frames) for a, b in old) if np.ptp(states[s[0] : s[1] + 1]) > 0]
    segments.sort()
    hull = [segments[0][0], segments[-1][1]] if segments else None
    return {**part, "states": states, "interval": hull, "motion_segments": segments}


def _segment(last_rest: int, next_rest: int, frames: Sequence[int]) -> list[int]:
    """New index of the last frame at rest before a motion and of the first one after it, or the clip's
    ends."""
    order = np.asarray(frames)
    before, after = (order <= last_rest, order >= next_rest)
    if order[0] > order[-1]:
        before, after = after, before
    start = np.flatnonzero(before)
    end = np.flatnonzero(after)
    return [int(start[-1]) if len(start) else 0, int(end[0]) if len(end) else len(order) - 1]


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kind", nargs="+", default=["reversed", "half"], choices=list(KINDS))
    args = parser.parse_args(argv)
    try:
        for kind in args.kind:
            target = args.out / f"{args.recording.resolve().name}_{kind.replace('-', '_')}"
            print(write_variant(args.recording, target, kind))
    except FuntwinError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
