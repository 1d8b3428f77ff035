"""Write a recording in the layouts of phone apps, as the apps do.

Poses must be known; without them the camera stands still and level. Depth is sampled at the app's own
resolution; where it is unknown it becomes a guess of low confidence, as on a phone.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Collection
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import recon
from benchmarks.layouts.videos import FrameClock, write_video

GUESS = 3000  # mm, depth of what the sensor did not see
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 97]
LEVEL = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]])


def write_stray(
    recording: recon.Recording,
    out: Path,
    depth_size: tuple[int, int] = (256, 192),
    per_frame: bool = False,
    first: int = 0,
    without_depth: Collection[int] = (),
    **video: Any,
) -> Path:
    """Stray Scanner. per_frame: the newer app's columns. first: number of the first frame. video: options of
    `write_video`.

    The app stamps its video by a counter from -1 on at 60 a second, whatever the frames' times, and its first
    frame is cut off by the file's edit list.
    """
    (out / "depth").mkdir(parents=True)
    (out / "confidence").mkdir()
    extra = ", fx, fy, cx, cy, distortion_center_x, distortion_center_y" if per_frame else ""
    odometry = [f"timestamp, frame, x, y, z, qx, qy, qz, qw{extra}"]
    k = recording.intrinsics
    for i, T in enumerate(_poses(recording)):
        T = y_up(T)
        numbers = ", ".join(f"{v:.9g}" for v in [*T[:3, 3], *xyzw(T[:3, :3])])
        own = f", {k.fx}, {k.fy}, {k.cx}, {k.cy}, , " if per_frame else ""
        odometry.append(f"{recording.times[i]:.9f}, {first + i:06d}, {numbers}{own}")
        if i not in without_depth:
            _write_depth(recording.depth(i), depth_size, out, f"{first + i:06d}")
    (out / "odometry.csv").write_text("\n".join(odometry) + "\n")
    (out / "camera_matrix.csv").write_text(f"{k.fx}, 0.0, {k.cx}\n0.0, {k.fy}, {k.cy}\n0.0, 0.0, 1.0")
    imu = "".join(f"{t:.6f}, 0.01, -0.98, 0.05, 0.0, 0.0, 0.0\n" for t in recording.times)  # in g
    (out / "imu.csv").write_text("timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n" + imu)
    write_video(recording, out / "rgb.mp4", FrameClock(Fraction(1, 60), start=-1), **video)
    return out


def write_record3d_exr(
    recording: recon.Recording,
    out: Path,
    depth_size: tuple[int, int] = (256, 192),
    missing: Collection[int] = (),
    stamps: bool = True,
    suffix: str = ".jpg",
) -> Path:
    """Record3D's EXR and RGB. missing: numbers whose pictures were dropped. stamps: False leaves the rate
    alone."""
    import OpenEXR

    folder = out / "EXR_RGBD"
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    meta = _record3d_metadata(recording)
    if not stamps:
        del meta["frameTimestamps"]
    (folder / "metadata.json").write_text(json.dumps(meta))
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for i in range(len(recording)):
        if i in missing:
            continue
        cv2.imwrite(str(folder / "rgb" / f"{i}{suffix}"), recording.color(i)[..., ::-1], JPEG)
        metres = sampled(recording.depth(i), depth_size).astype(np.float16)
        OpenEXR.File(header, {"R": metres}).write(str(folder / "depth" / f"{i}.exr"))
    return out


def write_r3d(recording: recon.Recording, out: Path, depth_size: tuple[int, int] = (256, 192)) -> Path:
    """Record3D's .r3d with raw payloads (the app compresses them)."""
    meta = _record3d_metadata(recording)
    k = recording.intrinsics
    meta |= {"dw": depth_size[0], "dh": depth_size[1]}
    meta["perFrameIntrinsicCoeffs"] = [[k.fx, k.fy, k.cx, k.cy]] * len(recording)
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("metadata", json.dumps(meta))
        for i in range(len(recording)):
            image = cv2.imencode(".jpg", recording.color(i)[..., ::-1], JPEG)[1]
            metres = sampled(recording.depth(i), depth_size)
            archive.writestr(f"rgbd/{i}.jpg", image.tobytes())
            archive.writestr(f"rgbd/{i}.depth", np.where(metres > 0, metres, np.nan).astype("<f4").tobytes())
            archive.writestr(f"rgbd/{i}.conf", np.where(metres > 0, 2, 0).astype(np.uint8).tobytes())
    return out


def _record3d_metadata(recording: recon.Recording) -> dict[str, Any]:
    k = recording.intrinsics
    rows = []
    for T in _poses(recording):
        T = arkit_camera(T)
        rows.append([*xyzw(T[:3, :3]), *T[:3, 3].tolist()])
    return {
        "w": k.width,
        "h": k.height,
        "K": [k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1],
        "fps": 60,
        "poses": rows,
        "frameTimestamps": recording.times.tolist(),
    }


def write_polycam(
    recording: recon.Recording, out: Path, depth_size: tuple[int, int] = (256, 192), corrected: bool = True
) -> Path:
    """Polycam's raw data. The images and cameras as recorded are off: black pictures, poses 5 cm beside those
    that are corrected."""
    folder = out / "keyframes"
    exact = ("corrected_images", "corrected_cameras") if corrected else ("images", "cameras")
    for name in ("images", "cameras", "depth", "confidence", *exact):
        (folder / name).mkdir(parents=True, exist_ok=True)
    k = recording.intrinsics
    for i, T in enumerate(_poses(recording)):
        name = str(round(recording.times[i] * 1e6))
        color = recording.color(i)[..., ::-1]
        aside = T.copy()
        aside[0, 3] += 0.05
        if corrected:
            _write_polycam(folder / "images" / name, folder / "cameras" / name, 0 * color, k, aside)
        _write_polycam(folder / exact[0] / name, folder / exact[1] / name, color, k, T)
        _write_depth(recording.depth(i), depth_size, folder, name, high=255)
    return out


def _write_polycam(image: Path, camera: Path, color: NDArray[Any], k: Any, T: NDArray[Any]) -> None:
    cv2.imwrite(f"{image}.jpg", color, JPEG)
    T = arkit_camera(T)
    values = {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": k.width, "height": k.height}
    values |= {f"t_{i}{j}": float(T[i, j]) for i in range(3) for j in range(4)}
    Path(f"{camera}.json").write_text(json.dumps({**values, "blur_score": 81.3}))


def write_scanner_app(
    recording: recon.Recording, out: Path, depth_size: tuple[int, int] = (256, 192), every: int = 1
) -> Path:
    """3D Scanner App. every: how many frames there are to one with a JPEG."""
    out.mkdir(parents=True)
    k = recording.intrinsics
    for i, T in enumerate(_poses(recording)):
        described = {
            "time": float(recording.times[i]),
            "frame_index": i,
            "intrinsics": [k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1],
            "cameraPoseARFrame": arkit_camera(T).ravel().tolist(),
            "motionQuality": 1,
        }
        (out / f"frame_{i:05d}.json").write_text(json.dumps(described))
        if i % every == 0:
            cv2.imwrite(str(out / f"frame_{i:05d}.jpg"), recording.color(i)[..., ::-1], JPEG)
        millimetres, confidence = sensed(recording.depth(i), depth_size)
        cv2.imwrite(str(out / f"depth_{i:05d}.png"), millimetres)
        cv2.imwrite(str(out / f"conf_{i:05d}.png"), confidence)
    return out


def write_arkit_scenes(
    recording: recon.Recording, out: Path, size: tuple[int, int] = (256, 192), nested: bool = False
) -> Path:
    """ARKitScenes, whose colour and depth are of one size. nested: in the folder <video>_frames/ of data set
    3dod."""
    folder = out / f"{out.name}_frames" if nested else out
    for name in ("lowres_wide", "lowres_depth", "confidence", "lowres_wide_intrinsics"):
        (folder / name).mkdir(parents=True)
    k = recording.intrinsics
    sx, sy = size[0] / k.width, size[1] / k.height
    camera = [*size, k.fx * sx, k.fy * sy, (k.cx + 0.5) * sx - 0.5, (k.cy + 0.5) * sy - 0.5]
    lines = []
    for i, T in enumerate(_poses(recording)):
        name = f"{out.name}_{recording.times[i]:.3f}"
        small = cv2.resize(recording.color(i), size, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / "lowres_wide" / f"{name}.png"), small[..., ::-1])
        (folder / "lowres_wide_intrinsics" / f"{name}.pincam").write_text(" ".join(f"{v:g}" for v in camera))
        millimetres, confidence = sensed(recording.depth(i), size)
        cv2.imwrite(str(folder / "lowres_depth" / f"{name}.png"), millimetres)
        cv2.imwrite(str(folder / "confidence" / f"{name}.png"), confidence)
        inverse = np.linalg.inv(T)
        turn = cv2.Rodrigues(inverse[:3, :3])[0].ravel()
        lines.append(" ".join(f"{v:.12g}" for v in (recording.times[i], *turn, *inverse[:3, 3])))
    (folder / "lowres_wide.traj").write_text("\n".join(lines) + "\n")
    return out


def write_video_folder(recording: recon.Recording, out: Path, suffix: str = ".mp4", **video: Any) -> Path:
    """A video beside depth/ and intrinsic.json, its times in the video. video: options of `write_video`."""
    (out / "depth").mkdir(parents=True)
    k = recording.intrinsics
    matrix = [k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1]
    described = {"width": k.width, "height": k.height, "intrinsic_matrix": matrix}
    (out / "intrinsic.json").write_text(json.dumps(described))
    for i in range(len(recording)):
        cv2.imwrite(str(out / "depth" / f"{i:06d}.png"), _millimetres(recording.depth(i)))
    write_video(recording, out / f"clip{suffix}", **video)
    return out


def arkit_camera(T_world_cam: NDArray[Any]) -> NDArray[Any]:
    """A pose of a z-up world and OpenCV's camera axes as ARKit tells it: the world's y up, the camera's y up,
    it looks along -z."""
    T = y_up(T_world_cam)
    T[:, 1] *= -1
    T[:, 2] *= -1
    return T


def y_up(T_world_cam: NDArray[Any]) -> NDArray[Any]:
    """A pose whose world has y up instead of z: its x stays, its old y points backwards along -z."""
    return np.stack([T_world_cam[0], T_world_cam[2], -T_world_cam[1], T_world_cam[3]])


def xyzw(rotation: NDArray[Any]) -> list[float]:
    """Quaternion of a rotation by its axis and angle."""
    turn = cv2.Rodrigues(rotation)[0].ravel()
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > 0 else turn
    return [*(axis * np.sin(angle / 2)).tolist(), float(np.cos(angle / 2))]


def sampled(metres: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Depth (h, w) m at the nearest pixel of each pixel of another grid over the same view."""
    h, w = metres.shape
    rows = ((np.arange(size[1]) + 0.5) * h / size[1]).astype(int)
    columns = ((np.arange(size[0]) + 0.5) * w / size[0]).astype(int)
    return metres[np.ix_(rows, columns)]


def sensed(metres: NDArray[Any], size: tuple[int, int], high: int = 2) -> tuple[NDArray[Any], NDArray[Any]]:
    """Depth (h, w) uint16 mm and its confidence uint8, up to `high`: medium in the last row, low where depth
    is a guess."""
    millimetres = _millimetres(sampled(metres, size))
    confidence = np.full(millimetres.shape, high, np.uint8)
    confidence[-1] = high // 2
    confidence[millimetres == 0] = 0
    return np.where(millimetres == 0, GUESS, millimetres).astype(np.uint16), confidence


def _millimetres(metres: NDArray[Any]) -> NDArray[Any]:
    return np.rint(metres * 1000).astype(np.uint16)


def _write_depth(metres: NDArray[Any], size: tuple[int, int], folder: Path, name: str, high: int = 2) -> None:
    millimetres, confidence = sensed(metres, size, high)
    cv2.imwrite(str(folder / "depth" / f"{name}.png"), millimetres)
    cv2.imwrite(str(folder / "confidence" / f"{name}.png"), confidence)


def _poses(recording: recon.Recording) -> list[NDArray[Any]]:
    if recording.poses is None:
        return [LEVEL.copy() for _ in range(len(recording))]
    return [np.array(T) for T in recording.poses.T_world_cam]
