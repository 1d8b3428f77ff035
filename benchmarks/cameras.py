"""Camera paths of walks beside those of other programs on the same frames: rows for `cameras.md`.

    python -m benchmarks.cameras RECORDING RUN [RECORDING RUN ...]

RUN is a finished run of RECORDING, which holds its truth. The others are Open3D's tensor SLAM system (frame
to model, by the settings of its own example), its odometry from frame to frame, and OpenCV's. None of them is
told where hands are. A frame that a program can't pose keeps the pose before it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from recon.evaluation.walk_cameras import aligned_pieces, in_truth, local_errors
from recon.readers import open_recording
from recon.recording import Recording
from recon.recording.decoded import decoded_once
from twin.geometry import Array
from twin.scene import Trajectory
from twin.storage import load

# m; of Open3D's example of dense SLAM, as is the distance
_VOXEL, _BLOCKS, _FARTHEST = 0.0058, 40_000, 3.0
# m; for OpenCV
_FARTHEST_PAIR = 5.0


def by_open3d(recording: Recording) -> Array:
    """Poses (T, 4, 4) by Open3D's tensor system: each frame is laid onto the model of those before."""
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    slam, camera = o3d.t.pipelines.slam, recording.intrinsics
    matrix = o3d.core.Tensor(camera.matrix)
    device = o3d.core.Device("CPU:0")
    model = slam.Model(_VOXEL, 16, _BLOCKS, o3d.core.Tensor(np.eye(4)), device)
    now, before = (slam.Frame(camera.height, camera.width, matrix, device) for _ in range(2))
    poses = [np.eye(4)]
    for k, (color, depth) in enumerate(recording):
        whole = np.ascontiguousarray((depth * 1000.0).round().astype(np.uint16))
        now.set_data_from_image("depth", o3d.t.geometry.Image(o3d.core.Tensor(whole)))
        now.set_data_from_image("color", o3d.t.geometry.Image(o3d.core.Tensor(color)))
        if k:
            try:
                step = model.track_frame_to_model(now, before, 1000.0, _FARTHEST)
                poses.append(poses[-1] @ step.transformation.cpu().numpy())
            except RuntimeError:
                poses.append(poses[-1])
        model.update_frame_pose(k, o3d.core.Tensor(poses[-1]))
        model.integrate(now, 1000.0, _FARTHEST)
        model.synthesize_model_frame(before, 1000.0, 0.1, _FARTHEST)
    return np.stack(poses)


def by_open3d_pairs(recording: Recording) -> Array:
    """Poses (T, 4, 4) by Open3D's tensor odometry, point to plane, from each frame to the next."""
    import open3d as o3d

    odometry, matrix = o3d.t.pipelines.odometry, o3d.core.Tensor(recording.intrinsics.matrix)
    still, criteria = (
        o3d.core.Tensor(np.eye(4)),
        [odometry.OdometryConvergenceCriteria(n) for n in (10, 5, 3)],
    )

    def of(k: int) -> object:
        color, depth = recording.frame(k)
        whole = np.ascontiguousarray((depth * 1000.0).round().astype(np.uint16))
        images = (o3d.t.geometry.Image(o3d.core.Tensor(i)) for i in (color, whole))
        return o3d.t.geometry.RGBDImage(*images)

    poses, last = [np.eye(4)], of(0)
    for k in range(1, len(recording)):
        now = of(k)
        try:
            step = odometry.rgbd_odometry_multi_scale(
                now, last, matrix, still, 1000.0, _FARTHEST, criteria, odometry.Method.PointToPlane
            )
            poses.append(poses[-1] @ step.transformation.numpy())
        except RuntimeError:
            poses.append(poses[-1])
        last = now
    return np.stack(poses)


def by_opencv(recording: Recording) -> Array:
    """Poses (T, 4, 4) by OpenCV's RGB-D odometry from each frame to the next."""
    camera, settings = recording.intrinsics, cv2.OdometrySettings()
    settings.setCameraMatrix(
        np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], np.float32)
    )
    settings.setMaxDepth(_FARTHEST_PAIR)
    odometry = cv2.Odometry(cv2.OdometryType_RGB_DEPTH, settings, cv2.OdometryAlgoType_COMMON)
    poses, last = [np.eye(4)], recording.frame(0)
    for k in range(1, len(recording)):
        now = recording.frame(k)
        told, step = odometry.compute(now.depth, now.color, last.depth, last.color)
        poses.append(poses[-1] @ step if told else poses[-1])
        last = now
    return np.stack(poses)


def row(name: str, cameras: Trajectory, truth: Truth, seconds: float | None) -> str:
    """Frames with a pose, error of the path, of relative poses in interactions, and time."""
    cameras = in_truth(cameras, truth)
    pieces = aligned_pieces(cameras, truth, None)
    local = local_errors(cameras, truth, pieces)
    centres = truth.cameras.T_world_cam[:, :3, 3] if truth.cameras is not None else np.zeros((2, 3))
    way = float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())
    ate = pieces[0].errors.ate_mm
    off, turn = np.asarray(local.mm), np.asarray(local.deg)
    told = "" if seconds is None else f"{1e3 * seconds / truth.frames:.0f}"
    return (
        f"| {name} | {len(cameras.frames)} of {truth.frames} | {ate:.1f} | {ate / way / 10:.2f} | {np.median(off):.1f} | "
        f"{np.quantile(off, 0.9):.1f} | {np.median(turn):.2f} | {told} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+", metavar="RECORDING RUN")
    folders = parser.parse_args().folders
    if len(folders) % 2:
        parser.error("give each recording with its run")
    print("| walk, program | posed | path, mm | % of way | within, mm | p90 | within, ° | ms a frame |")
    print("|---|---|---|---|---|---|---|---|")
    others: dict[str, Callable[[Recording], Array]] = {
        "Open3D's SLAM": by_open3d,
        "Open3D, pairs": by_open3d_pairs,
        "OpenCV, pairs": by_opencv,
    }
    for folder, run in zip(folders[::2], folders[1::2], strict=True):
        truth, cameras = load_truth(folder / "truth"), load(run).cameras
        assert cameras is not None
        print(row(f"{run.parent.name}, Funtwin", cameras, truth, None), flush=True)
        with decoded_once(open_recording(folder), None) as recording:
            for name, find in others.items():
                start = time.perf_counter()
                poses = find(recording)
                took = time.perf_counter() - start
                path = Trajectory(np.arange(len(poses)), np.asarray(recording.times), poses)
                print(row(f"{run.parent.name}, {name}", path, truth, took), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
