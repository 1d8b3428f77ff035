"""One small recording in every layout that is read, by writers that share no code with the readers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.layouts.azure_kinect import write_azure_kinect
from benchmarks.layouts.datasets import (
    write_arti4d,
    write_bundlesdf,
    write_hoi4d,
    write_itaco_real,
    write_itaco_rendered,
    write_scannet,
)
from benchmarks.layouts.phones import (
    write_arkit_scenes,
    write_polycam,
    write_r3d,
    write_record3d_exr,
    write_scanner_app,
    write_stray,
    write_video_folder,
)
from benchmarks.layouts.ros import write_ros1, write_ros2
from benchmarks.layouts.ros_realsense import write_realsense
from recon.recording import Recording
from recon.recording.write import write_recording
from twin.geometry import make_pose

# case -> (reader, name of the file or folder, writer)
LAYOUTS: dict[str, tuple[str, str, Callable[[Recording, Path], Any]]] = {
    "native": ("native", "clip", write_recording),
    "tum": ("tum", "clip", lambda r, out: write_recording(r, out, "tum")),
    "record3d": ("record3d", "clip.r3d", lambda r, out: write_r3d(r, out, (32, 24))),
    "record3d_exr": ("record3d_exr", "clip", lambda r, out: write_record3d_exr(r, out, (32, 24))),
    "stray_scanner": ("stray_scanner", "clip", lambda r, out: write_stray(r, out, (32, 24))),
    "polycam": ("polycam", "clip", lambda r, out: write_polycam(r, out, (32, 24))),
    "scanner_app": ("scanner_app", "clip", lambda r, out: write_scanner_app(r, out, (32, 24))),
    "arkit_scenes": ("arkit_scenes", "clip", lambda r, out: write_arkit_scenes(r, out, (96, 72))),
    "azure_kinect": ("azure_kinect", "clip.mkv", write_azure_kinect),
    "ros1": ("ros", "clip.bag", write_ros1),
    "ros2": ("ros", "clip", write_ros2),
    "mcap": ("ros", "clip", lambda r, out: write_ros2(r, out, storage="mcap")),
    "realsense": (
        "ros",
        "clip.bag",
        lambda r, out: write_realsense(r, out, make_pose(translation=[-0.015, 0, 0])),
    ),
    "scannet": ("scannet", "clip.sens", write_scannet),
    "hoi4d": ("hoi4d", "clip", write_hoi4d),
    "arti4d": ("arti4d", "clip", write_arti4d),
    "itaco_rendered": ("itaco", "clip", write_itaco_rendered),
    "itaco_real": ("itaco", "clip", write_itaco_real),
    "bundlesdf": ("bundlesdf", "clip", write_bundlesdf),
    "video_folder": ("video_folder", "clip", write_video_folder),
}


def write_layout(case: str, recording: Recording, folder: Path) -> Path:
    """The recording in one of `LAYOUTS`; the path to open."""
    _, name, write = LAYOUTS[case]
    folder.mkdir(parents=True, exist_ok=True)
    made = write(recording, folder / name)
    # some lie deep in a tree of their data set
    return made if isinstance(made, Path) else folder / name
