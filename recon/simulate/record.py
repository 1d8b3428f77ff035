"""Writing a recording and its truth: the native layout, with truth/ beside the images."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.grip import Grasp
from recon.simulate.hand_path import HandMotion
from recon.simulate.mjcf import Articulation
from recon.simulate.render import Camera
from recon.simulate.surfaces import Surface, merged_mesh
from recon.simulate.timeline import Timeline
from twin.errors import InputError
from twin.files.atomic import put, staging
from twin.geometry import Array, quat_wxyz_from_matrix, transform

PART_ID, HAND_LABEL, STATIC_LABEL = 2, 255, 1
JPEG_QUALITY = 93


@dataclass(frozen=True)
class Truth:
    """Everything that is exactly known about a recording; arrays over all frames."""

    scene: Articulation
    still: tuple[Surface, ...]
    grasp: Grasp
    timeline: Timeline
    states: Array
    times: Array
    cameras: Array
    hand: HandMotion
    keypoints: Array


@contextmanager
def new_recording(out: Path) -> Iterator[Path]:
    """A folder to write a recording into, which stands as `out` at the end, whole, or not at all.

    Raises InputError when `out` holds files already or can't be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists and is not an empty folder", "choose a new folder for the recording")
    try:
        with staging(out.resolve()) as staged:
            for name in ("color", "depth", "truth/labels"):
                (staged / name).mkdir(parents=True, exist_ok=True)
            yield staged
            put(staged, out.resolve(), ())
    except OSError as error:
        raise InputError(f"can't write the folder {out}: {error.strerror}", "choose another place") from error


def write_frame(
    out: Path, index: int, colour: NDArray[np.uint8], depth: NDArray[np.uint16], labels: NDArray[np.uint8]
) -> None:
    """Write one frame: colour (H, W, 3) RGB, depth (H, W) mm, labels (H, W)."""
    _image(out / "color" / f"{index:06d}.jpg", colour[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    _image(out / "depth" / f"{index:06d}.png", depth, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    _image(out / "truth" / "labels" / f"{index:06d}.png", labels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def _image(path: Path, image: NDArray[Any], options: list[int]) -> None:
    good, data = cv2.imencode(path.suffix, np.ascontiguousarray(image), options)
    if not good:
        raise InputError(f"can't encode {path.name}", "check the size of the images")
    path.write_bytes(data.tobytes())


def write_truth(out: Path, truth: Truth, camera: Camera) -> None:
    """Write intrinsics, time stamps and the truth/ folder (labels are written with the frames)."""
    cx, cy = camera.centre
    matrix = [camera.focal, 0, 0, 0, camera.focal, 0, cx, cy, 1]
    intrinsic = {"width": camera.width, "height": camera.height, "intrinsic_matrix": matrix}
    (out / "intrinsic.json").write_text(json.dumps(intrinsic, indent=1) + "\n")
    (out / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in truth.times))
    folder = out / "truth"
    lines = ["# timestamp tx ty tz qx qy qz qw   (camera to world, OpenCV camera axes, metres)"]
    for t, pose in zip(truth.times, truth.cameras, strict=True):
        w, x, y, z = quat_wxyz_from_matrix(pose[:3, :3])
        lines.append(f"{t:.6f} " + " ".join(f"{v:.9f}" for v in (*pose[:3, 3], x, y, z, w)))
    (folder / "trajectory.txt").write_text("\n".join(lines) + "\n")
    poses = np.stack([truth.scene.pose(float(s)) for s in truth.states])
    arrays: dict[str, Any] = {f"part_{PART_ID}": poses}
    np.savez_compressed(folder / "part_poses.npz", **arrays)
    merged_mesh(list(truth.scene.part)).export(folder / f"part_{PART_ID}.ply")
    merged_mesh(list(truth.still)).export(folder / "static.ply")
    keypoints: dict[str, Any] = hand_arrays(truth, camera)
    np.savez_compressed(folder / "hand_keypoints.npz", **keypoints)
    (folder / "truth.json").write_text(json.dumps(truth_json(truth), indent=1) + "\n")


def hand_arrays(truth: Truth, camera: Camera) -> dict[str, NDArray[Any]]:
    """Keypoints in the world, in pixels (NaN behind the camera), their depth, whether in view, and hand poses."""
    n = len(truth.states)
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
    """The dictionary of truth.json: joint, states, interval and physics of the part; the hand's contact."""
    scene, line, contact = truth.scene, truth.timeline, truth.timeline.in_contact()
    interval = [line.start, line.end]
    points = [
        transform(scene.pose(float(s)), truth.grasp.point[None])[0].tolist() if held else None
        for s, held in zip(truth.states, contact, strict=True)
    ]
    part = {
        "id": PART_ID,
        "name": scene.name,
        "description": describe(scene),
        "type": scene.kind,
        "axis_world": scene.axis.tolist(),
        "pivot_world": scene.pivot.tolist(),
        "range": [0.0, scene.span],
        "states": truth.states.tolist(),
        "interval": interval,
        "motion_segments": [interval],
        "mass": scene.mass,
        "com_world": scene.com.tolist(),
        "inertia": scene.inertia.tolist(),
        "inertia_order": "xx yy zz xy xz yz about the centre of mass, world axes at state 0, kg m^2",
        "grip": {
            "point_world": truth.grasp.point.tolist(),
            "along_world": truth.grasp.bar.tolist(),
            "outward_world": truth.grasp.outward.tolist(),
            "width": truth.grasp.width,
            "source": truth.grasp.source,
        },
    }
    return {
        "world": "z-up, metres",
        "frames": line.frames,
        "fps": round(1.0 / float(truth.times[1] - truth.times[0]), 6),
        "labels": {
            "0": "none",
            str(STATIC_LABEL): "static",
            str(HAND_LABEL): "hand",
            str(PART_ID): scene.name,
        },
        "parts": [part],
        "hand": {
            "contact": contact,
            "contact_part": [PART_ID if held else None for held in contact],
            "contact_point_world": points,
            "side": "right",
            "grip_frame_world": "T_world_hand in hand_keypoints.npz: z along the gripped bar, "
            "y the approach direction",
        },
    }
