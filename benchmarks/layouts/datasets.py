"""Recordings written in the layouts of data sets: ScanNet, HOI4D, Arti4D, iTACO, BundleSDF, with their
annotations."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import recon
from recon.recording import Intrinsics

Array = NDArray[np.float64]

CLIP = "ZY20210800001/H1/C4/N11/S1/s1/T1"
ROOM, SCENE = "rh201", "scene_2025-04-25-10-36-37"
FIRST_NS = 1_745_570_197_123_456_789
# An Azure Kinect on its holder: as the driver tells it, the numbers near those that the data set publishes.
AZURE_TF = {
    "depth_T_rgb": {
        "translation": {"x": 0.03198, "y": 0.00241, "z": -0.00378},
        "rotation": {"x": 0.0480374860, "y": -8.677599741e-05, "z": 0.00010927860, "w": 0.9988455218},
    },
    "base_T_depth": {
        "translation": {"x": 0.0, "y": 0.0, "z": 0.0018},
        "rotation": {"x": 0.5254827455, "y": -0.5254827455, "z": 0.4731467893, "w": -0.4731467893},
    },
}


def millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    return np.rint(depth * 1000.0).astype(np.uint16)


def jpeg(color: NDArray[np.uint8]) -> bytes:
    return cv2.imencode(".jpg", color[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()


def png(image: NDArray[Any]) -> bytes:
    return cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)[1].tobytes()


def matrix4(K: Intrinsics) -> Array:
    out = np.eye(4)
    out[:3, :3] = [[K.fx, 0, K.cx], [0, K.fy, K.cy], [0, 0, 1]]
    return out


def rows(T: Array) -> bytes:
    """A matrix as ScanNet stores it: float32, row by row."""
    return struct.pack("<16f", *np.asarray(T).ravel())


def write_scannet(
    recording: recon.Recording,
    out: Path,
    T_world_color: Array | None = None,
    *,
    color: str = "jpeg",
    depth: str = "zlib",
    times: bool = True,
    depth_to_color: Array | None = None,
    depth_step: int = 1,
    lost: Sequence[int] = (),
    per_metre: float = 1000.0,
) -> Path:
    """A .sens; depth_step: every so manieth pixel of depth is kept, as of a coarser camera in the same
    place."""
    E = np.eye(4) if depth_to_color is None else depth_to_color
    K = recording.intrinsics
    K_depth = matrix4(K)
    K_depth[:2] /= depth_step
    first = recording.depth(0)[::depth_step, ::depth_step]
    name = b"StructureSensor"
    head = (
        struct.pack("<IQ", 4, len(name)) + name + rows(matrix4(K)) + rows(np.eye(4)) + rows(K_depth) + rows(E)
    )
    head += struct.pack(
        "<ii", {"raw": 0, "png": 1, "jpeg": 2}[color], {"raw": 0, "zlib": 1, "occi": 2}[depth]
    )
    head += struct.pack("<IIII", K.width, K.height, first.shape[1], first.shape[0])
    head += struct.pack("<fQ", per_metre, len(recording))
    chunks = [head]
    for k, t in enumerate(recording.times):
        image = recording.color(k)
        shown = {"raw": image.tobytes, "png": lambda i=image: png(i), "jpeg": lambda i=image: jpeg(i)}[
            color
        ]()
        counts = np.rint(recording.depth(k)[::depth_step, ::depth_step] * per_metre).astype("<u2").tobytes()
        packed = zlib.compress(counts) if depth == "zlib" else counts
        T = np.eye(4) if T_world_color is None else T_world_color[k] @ E  # the depth camera's
        stamp = round(t * 1e6) if times else 0
        pose = np.full((4, 4), -np.inf) if k in lost else T
        chunks += [rows(pose), struct.pack("<QQQQ", stamp, stamp, len(shown), len(packed)), shown, packed]
    out.write_bytes(b"".join(chunks))
    return out


def write_hoi4d(recording: recon.Recording, out: Path, *, clip: str = CLIP, nested: bool = False) -> Path:
    """Decoded images of a clip and its camera's parameters; the clip's folder."""
    folder = out / "HOI4D_release" / clip
    for name in ("align_rgb", "align_depth"):
        (folder / name).mkdir(parents=True)
    for k in range(len(recording)):
        (folder / "align_rgb" / f"{k:05d}.jpg").write_bytes(jpeg(recording.color(k)))
        (folder / "align_depth" / f"{k:05d}.png").write_bytes(png(millimetres(recording.depth(k))))
    camera = out / "camera_params" / ("camera_params" if nested else "") / clip.split("/")[0]
    camera.mkdir(parents=True)
    np.save(camera / "intrin.npy", matrix4(recording.intrinsics)[:3, :3])
    return folder


def write_hoi4d_annotations(
    folder: Path,
    T_world_cam: Array,
    parts: Sequence[tuple[str, Array, Sequence[float]]],
    events: Sequence[tuple[str, float, float]] | None = None,
    duration: float | None = None,
) -> Path:
    """parts: label, T_world_part (n, 4, 4) of the middle of its box, and the box's size; events: name, first
    and last s."""
    for name in ("objpose", "3Dseg", "action"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for k, T in enumerate(T_world_cam):
        entries = []
        for label, T_world_part, size in parts:
            pose = np.linalg.inv(T) @ T_world_part[k]
            angles = Rotation.from_matrix(pose[:3, :3]).as_euler("XYZ")
            entries.append(
                {
                    "label": label,
                    "center": dict(zip("xyz", pose[:3, 3].tolist(), strict=True)),
                    "rotation": dict(zip("xyz", angles.tolist(), strict=True)),
                    "dimensions": dict(zip(("length", "width", "height"), size, strict=True)),
                }
            )
        (folder / "objpose" / f"{k}.json").write_text(json.dumps({"dataList": entries}))
    blocks = []
    for k, T in enumerate(T_world_cam):
        numbers = "\n".join(" ".join(f"{v:.12f}" for v in row) for row in T)
        blocks.append(f"{k} {k} {k + 1}\n{numbers}\n")
    (folder / "3Dseg" / "output.log").write_text("".join(blocks))
    if events is not None:
        marks = [{"event": name, "startTime": first, "endTime": last} for name, first, last in events]
        data = {"info": {"duration": duration or len(T_world_cam) / 15.0}, "events": marks}
        (folder / "action" / "color.json").write_text(json.dumps(data))
    return folder


def camera_info(K: Intrinsics, D: Sequence[float] = (0.0,) * 8) -> str:
    """A message of ROS as it is printed."""
    flat = ", ".join(f"{v!r}" for v in matrix4(K)[:3, :3].ravel().tolist())
    return (
        f'header: \n  seq: 0\n  stamp: \n    secs: 1\n    nsecs: 2\n  frame_id: "rgb_camera_link"\nheight: {K.height}\n'
        f'width: {K.width}\ndistortion_model: "rational_polynomial"\nD: ({", ".join(map(str, D))})\nK: ({flat})\n'
    )


def _T(entry: Mapping[str, Mapping[str, float]]) -> Array:
    out = np.eye(4)
    out[:3, :3] = Rotation.from_quat([entry["rotation"][k] for k in "xyzw"]).as_matrix()
    out[:3, 3] = [entry["translation"][k] for k in "xyz"]
    return out


def write_arti4d(
    recording: recon.Recording,
    out: Path,
    T_map_cam: Array | None = None,
    *,
    axes: Mapping[str, tuple[str, Sequence[float], Sequence[float]]] | None = None,
    cues: Sequence[tuple[str, int, int, str]] = (),
    slam: bool = False,
    D: Sequence[float] = (0.0,) * 8,
) -> Path:
    """A scene with odometry, or with DROID-SLAM's trajectory; axes: type, direction, point by name; the
    scene's folder."""
    folder = out / "raw" / ROOM / SCENE
    for name in ("rgb", "depth", "odom"):
        (folder / name).mkdir(parents=True)
    stamps = [FIRST_NS + round((t - recording.times[0]) * 1e9) for t in recording.times]
    for k, ns in enumerate(stamps):
        (folder / "rgb" / f"rgb_image_{ns}.jpg").write_bytes(jpeg(recording.color(k)))
        (folder / "depth" / f"depth_image_{ns + 111}.png").write_bytes(png(millimetres(recording.depth(k))))
    for name in ("rgb", "depth"):
        (folder / name / "camera_info.txt").write_text(camera_info(recording.intrinsics, D))
    if T_map_cam is not None and slam:
        _write_slam(folder, stamps, T_map_cam)
    elif T_map_cam is not None:
        _write_odometry(out, folder, stamps, T_map_cam)
    if axes is not None:
        told = {n: {"position": list(p), "axis": list(a)} for n, (_, a, p) in axes.items()}
        (folder / f"{SCENE}.json").write_text(json.dumps(told))
        lines = [f"    {n}: {kind}  # annotated" for n, (kind, _, _) in axes.items()]
        difficulty = "\n".join(f"    {n}: EASY" for n in axes)
        (out / "raw" / "metadata.yaml").write_text(
            f"# Arti4D\njoint_types:\n {ROOM}:\n  {SCENE}:\n" + "\n".join(lines)
            + f"\n  'scene_2025-04-25-11-00-00':\n    door-1: REVOLUTE\ndifficulty:\n {ROOM}:\n  {SCENE}:\n{difficulty}\nscenes: [a, b]\n"
        )  # fmt: skip
        table = ["AXIS_NAME,CUE_START,CUE_END,VERIFICATION", *(",".join(map(str, c)) for c in cues)]
        (folder / "matched_cues.csv").write_text("\n".join(table) + "\n")
    return folder


def _write_odometry(out: Path, folder: Path, stamps: Sequence[int], T_map_cam: Array) -> None:
    """The tracker's poses: the camera's, without the half turn of its pictures, taken back to the tracker."""
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    base_T_rgb = _T(AZURE_TF["base_T_depth"]) @ _T(AZURE_TF["depth_T_rgb"])
    lines = ["timestamp, x, y, z, qx, qy, qz, qw"]
    for ns, T in zip(stamps, T_map_cam, strict=True):
        base = T @ turn @ np.linalg.inv(base_T_rgb)
        values = [*base[:3, 3], *Rotation.from_matrix(base[:3, :3]).as_quat()]
        lines.append(f"{ns // 10**9}.{ns % 10**9:09d}," + ",".join(f"{v:.12f}" for v in values))
    (folder / "odom" / f"{folder.name}.csv").write_text("\n".join(lines) + "\n")
    calibration = out / "meta" / "calibration"
    calibration.mkdir(parents=True)
    (calibration / "azure_tf.json").write_text(json.dumps(AZURE_TF))


def _write_slam(folder: Path, stamps: Sequence[int], T_map_cam: Array) -> None:
    """DROID-SLAM's: a world of its own, and qy qz qw qx under the names qx qy qz qw."""
    registration = np.eye(4)
    registration[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.2, 1.0]).as_matrix()
    registration[:3, 3] = [1.0, -2.0, 0.5]
    lines = ["timestamp,x,y,z,qx,qy,qz,qw"]
    for ns, T in zip(stamps, T_map_cam, strict=True):
        own = np.linalg.inv(registration) @ T
        x, y, z, w = Rotation.from_matrix(own[:3, :3]).as_quat()
        lines.append(f"{ns}," + ",".join(f"{v:.12f}" for v in [*own[:3, 3], y, z, w, x]))
    (folder / "cam_trajectory.csv").write_text("\n".join(lines) + "\n")
    (folder / "registration_matrix.json").write_text(
        json.dumps({"transformation_matrix": registration.ravel().tolist()})
    )


def write_itaco_rendered(recording: recon.Recording, out: Path, T_world_cam: Array | None = None) -> Path:
    """A view of a rendered object; T_world_cam with OpenCV's axes in a z-up world."""
    folder = out / "sim_data" / "partnet_mobility" / "Storage" / "45001" / "joint_0_bg" / "view_0"
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    for k in range(len(recording)):
        (folder / "rgb" / f"{k:06d}.jpg").write_bytes(jpeg(recording.color(k)))
        np.savez_compressed(folder / "depth" / f"{k:06d}.npz", a=recording.depth(k))
    np.save(folder / "intrinsics.npy", matrix4(recording.intrinsics)[:3, :3])
    if T_world_cam is not None:
        table = []
        for T in T_world_cam:
            # SAPIEN: x forward (OpenCV's z), y left (-x), z up (-y)
            R = np.column_stack([T[:3, 2], -T[:3, 0], -T[:3, 1]])
            x, y, z, w = Rotation.from_matrix(R).as_quat()
            table.append([*T[:3, 3], w, x, y, z])
        np.save(folder / "camera_pose.npy", np.array(table))
    return folder


def write_itaco_real(recording: recon.Recording, out: Path, T_world_cam: Array | None = None) -> Path:
    """A clip of a phone; T_world_cam with OpenCV's axes in a z-up world."""
    folder = out / "real_data" / "drawer"
    for name in ("rgb", "prompt_depth_video"):
        (folder / name).mkdir(parents=True)
    for k in range(len(recording)):
        (folder / "rgb" / f"{k}.jpg").write_bytes(jpeg(recording.color(k)))
        np.save(folder / "prompt_depth_video" / f"{k}.npy", recording.depth(k))
    K = recording.intrinsics
    meta: dict[str, Any] = {
        "w": K.width,
        "h": K.height,
        "K": matrix4(K)[:3, :3].T.ravel().tolist(),
        "fps": 15,
    }
    if T_world_cam is not None:
        meta["poses"] = []
        for T in T_world_cam:
            # ARKit: world y up (our z), camera y up and z backward
            R = np.column_stack([T[:3, 0], -T[:3, 1], -T[:3, 2]])
            to_y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
            meta["poses"].append([*Rotation.from_matrix(to_y_up @ R).as_quat(), *(to_y_up @ T[:3, 3])])
    (folder / "metadata.json").write_text(json.dumps(meta))
    np.save(folder / "cam2world.npy", np.eye(4))
    return folder


def write_bundlesdf(recording: recon.Recording, out: Path, masks: bool = True) -> Path:
    """A folder for BundleSDF."""
    for name in ("rgb", "depth", *(["masks"] if masks else [])):
        (out / name).mkdir(parents=True)
    for k in range(len(recording)):
        name = f"{1_000_000 + 33_333 * k}.png"
        (out / "rgb" / name).write_bytes(png(recording.color(k)))
        (out / "depth" / name).write_bytes(png(millimetres(recording.depth(k))))
        if masks:
            (out / "masks" / name).write_bytes(png(np.full(recording.depth(k).shape, 255, np.uint8)))
    np.savetxt(out / "cam_K.txt", matrix4(recording.intrinsics)[:3, :3])
    return out
