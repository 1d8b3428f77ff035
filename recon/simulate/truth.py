"""All that is known about a simulated recording, and the folder truth/ beside its images."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.simulate.grip import Grasp
from recon.simulate.hand_path import HandMotion
from recon.simulate.mjcf import Articulation
from recon.simulate.record import HAND_LABEL, OTHER_LABEL, STATIC_LABEL
from recon.simulate.render import Camera
from recon.simulate.surfaces import Surface, merged_mesh
from twin.geometry import Array, quat_wxyz_from_matrix, transform

FIRST_TIME = 1000.0  # seconds; a clock that does not start at zero, as real ones don't


@dataclass(frozen=True)
class TruthPart:
    """A part that is moved: its label, its state (frames,), rad or m, the frames (last at rest, first at rest
    again) of each motion, and in which frames (frames,) the hand holds it.
    """

    id: int
    part: Articulation
    grasp: Grasp
    states: Array
    segments: tuple[tuple[int, int], ...]
    held: NDArray[np.bool_]


@dataclass(frozen=True)
class Truth:
    """All that is exactly known about a recording; arrays over all frames. still: what never moves; others:
    whether something moves that is no part."""

    parts: tuple[TruthPart, ...]
    still: tuple[Surface, ...]
    times: Array
    cameras: Array
    hand: HandMotion
    keypoints: Array
    side: str
    others: bool = False


def write_truth(out: Path, truth: Truth, camera: Camera, depth_lag: int = 0) -> None:
    """Write time stamps and the truth/ folder (labels go with frames). depth_lag: frames, told if not 0."""
    (out / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in truth.times))
    folder = out / "truth"
    lines = ["# timestamp tx ty tz qx qy qz qw   (camera to world, OpenCV camera axes, metres)"]
    for t, pose in zip(truth.times, truth.cameras, strict=True):
        w, x, y, z = quat_wxyz_from_matrix(pose[:3, :3])
        lines.append(f"{t:.6f} " + " ".join(f"{v:.9f}" for v in (*pose[:3, 3], x, y, z, w)))
    (folder / "trajectory.txt").write_text("\n".join(lines) + "\n")
    arrays: dict[str, Any] = {
        f"part_{p.id}": np.stack([p.part.pose(float(s)) for s in p.states]) for p in truth.parts
    }
    np.savez_compressed(folder / "part_poses.npz", **arrays)
    for p in truth.parts:
        merged_mesh(list(p.part.part)).export(folder / f"part_{p.id}.ply")
        if p.part.furniture:
            merged_mesh(list(p.part.furniture)).export(folder / f"furniture_{p.id}.ply")
    merged_mesh(list(truth.still)).export(folder / "static.ply")
    keypoints: dict[str, Any] = hand_arrays(truth, camera)
    np.savez_compressed(folder / "hand_keypoints.npz", **keypoints)
    told = truth_json(truth) | ({"depth_lag": depth_lag} if depth_lag else {})
    (folder / "truth.json").write_text(json.dumps(told, indent=1) + "\n")


def hand_arrays(truth: Truth, camera: Camera) -> dict[str, NDArray[Any]]:
    """Keypoints in the world, in pixels (NaN behind the camera), their depth, if in view, and hand poses."""
    n = len(truth.times)
    in_camera = np.empty_like(truth.keypoints)
    for i in range(n):
        rotation, centre = truth.cameras[i, :3, :3], truth.cameras[i, :3, 3]
        in_camera[i] = (truth.keypoints[i] - centre) @ rotation
    pixels = camera.project(in_camera)
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= -0.5) & (pixels <= np.array([camera.width, camera.height]) - 0.5), axis=-1)
    return {
        "keypoints_world": truth.keypoints,
        "keypoints_px": pixels,
        "depth": in_camera[..., 2],
        "in_view": inside & np.array(truth.hand.present)[:, None],
        "T_world_hand": truth.hand.T_world_hand,
    }


def describe(scene: Articulation) -> str:
    """A sentence that says what the person does, such as "open the left door"."""
    words = scene.name.replace("_", " ").replace("-", " ").strip()
    if scene.kind == "prismatic":
        return f"open the {words} by sliding it"
    return f"open the {words} by turning it on its hinge"


def truth_json(truth: Truth) -> dict[str, Any]:
    """The dictionary of truth.json: joint, states, intervals and physics of the parts; the hand's contact."""
    labels = {"0": "none", str(STATIC_LABEL): "static", str(HAND_LABEL): "hand"}
    if not truth.parts or truth.others:
        labels[str(OTHER_LABEL)] = "what moves and is no part"
    labels |= {str(p.id): p.part.name for p in truth.parts}
    return {
        "world": "z-up, metres",
        "frames": len(truth.times),
        "fps": round(1.0 / float(truth.times[1] - truth.times[0]), 6),
        "labels": labels,
        "parts": [_part_json(p) for p in truth.parts],
        "hand": _hand_json(truth),
    }


def _part_json(known: TruthPart) -> dict[str, Any]:
    part, grasp = known.part, known.grasp
    segments = [list(s) for s in known.segments]
    return {
        "id": known.id,
        "name": part.name,
        "description": describe(part),
        "type": part.kind,
        "axis_world": part.axis.tolist(),
        "pivot_world": part.pivot.tolist(),
        "range": [0.0, part.span],
        "states": known.states.tolist(),
        "interval": [segments[0][0], segments[-1][1]] if segments else None,
        "motion_segments": segments,
        "mass": part.mass,
        "com_world": part.com.tolist(),
        "inertia": part.inertia.tolist(),
        "inertia_order": "xx yy zz xy xz yz about the centre of mass, world axes at state 0, kg m^2",
        "grip": {
            "point_world": grasp.point.tolist(),
            "along_world": grasp.bar.tolist(),
            "outward_world": grasp.outward.tolist(),
            "width": grasp.width,
            "source": grasp.source,
        },
    }


def _hand_json(truth: Truth) -> dict[str, Any]:
    holder = [next((p for p in truth.parts if p.held[i]), None) for i in range(len(truth.times))]
    points = [
        None if p is None else transform(p.part.pose(float(p.states[i])), p.grasp.point[None])[0].tolist()
        for i, p in enumerate(holder)
    ]
    return {
        "contact": [p is not None for p in holder],
        "contact_part": [None if p is None else p.id for p in holder],
        "contact_point_world": points,
        "side": truth.side,
        "grip_frame_world": "T_world_hand in hand_keypoints.npz: z along the gripped bar, "
        "y the approach direction",
    }
