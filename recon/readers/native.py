"""The native layout: Open3D's folders of colour and depth images with one intrinsic.json."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.fingerprint import fingerprint
from recon.readers.streams import Streams
from recon.readers.unread import COLOUR_ALONE
from recon.recording import MIN_FRAMES, Intrinsics, ReadColor, ReadDepth
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

COLOR_FOLDERS = ("color", "rgb", "image")  # the names that Open3D's reconstruction system knows
DEFAULT_FPS = 15.0  # chosen by us for recordings without timestamps.txt
DEPTH_PER_METRE = 1000.0


@dataclass(frozen=True)
class NativeReader:
    """Reads `color/`, `depth/`, `intrinsic.json` and the optional files beside them (docs/recordings.md)."""

    layout: str = "a folder with color/, depth/ (16-bit PNG in mm) and intrinsic.json"

    def recognises(self, path: Path) -> bool:
        return path.is_dir() and any((path / n).is_dir() for n in (*COLOR_FOLDERS, "depth"))

    def streams(self, path: Path) -> Streams:
        if not path.is_dir():
            raise InputError(f"{path} is not a folder", "name the folder that holds color/ and depth/")
        if (path / "rgb.txt").is_file() and (path / "depth.txt").is_file():
            raise InputError(
                f"{path} has the lists of TUM RGB-D, whose depth counts 5000 a metre", "leave --layout out"
            )
        color = _color_files(path)
        depth = _depth_files(path)
        _check_pairs(path, color, depth)
        intrinsics = _intrinsics(path, "intrinsic.json")
        video = video_facts(path)
        times, warnings = _times(path, color, video.fps)
        gravity, metadata = _metadata(path)
        rig = _rig(path, intrinsics)
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=times,
            depth_times=times,
            read_color=_color_reader(color, intrinsics),
            read_depth=depth_reader(depth, rig.depth.camera, video.depth_per_metre),
            rig=rig,
            fingerprint=fingerprint(path, [*color, *depth, *_side_files(path)]),
            poses=_poses(path, times),
            gravity=gravity,
            longest=None,
            warnings=warnings,
            metadata=metadata,
        )


def _color_files(path: Path) -> list[Path]:
    folders = [path / n for n in COLOR_FOLDERS if (path / n).is_dir()]
    if not folders:
        raise InputError(
            f"{path} has no folder color/; it holds {files.listing(path)}", "put the colour images there"
        )
    found = [p for p in folders[0].iterdir() if p.suffix.lower() in files.COLOR_SUFFIXES]
    if not found:
        raise InputError(
            f"{files.shown(folders[0])} holds no JPEG or PNG, but {files.listing(folders[0])}", "add images"
        )
    return sorted(found, key=files.natural_key)


def _depth_files(path: Path) -> list[Path]:
    folder = path / "depth"
    if not folder.is_dir():
        raise InputError(f"{path} has no folder depth/; it holds {files.listing(path)}", COLOUR_ALONE)
    found = sorted((p for p in folder.iterdir() if p.suffix.lower() == ".png"), key=files.natural_key)
    if found:
        return found
    floats = sorted(p for p in folder.iterdir() if p.suffix.lower() in files.FLOAT_DEPTH_SUFFIXES)
    if floats:
        raise InputError(
            f"{files.shown(floats[0])} looks like float depth ({floats[0].suffix}), probably in metres",
            "multiply by 1000, round, and save as one-channel 16-bit PNG, 0 = unknown",
        )
    raise InputError(
        f"{files.shown(folder)} holds no PNG, but {files.listing(folder)}",
        "put 16-bit PNG depth images in millimetres there",
    )


def _check_pairs(path: Path, color: list[Path], depth: list[Path]) -> None:
    """Raise InputError when colour and depth can't be paired by their order, naming the odd file."""
    in_color, in_depth = {p.stem for p in color}, {p.stem for p in depth}
    alike = len(in_color & in_depth) * 2 >= min(len(color), len(depth))
    odd = sorted(in_color ^ in_depth, key=files.natural_key)
    if len(color) == len(depth) and not (alike and odd):
        return
    where = ""
    if alike and odd:
        missing = "depth" if odd[0] in in_color else color[0].parent.name
        where = f"; {missing}/{odd[0]} is missing"
    raise InputError(
        f"{path} has {len(color)} colour and {len(depth)} depth images{where}",
        "keep exactly one depth image for every colour image",
    )


def _check_numbering(color: list[Path]) -> None:
    """Raise InputError when numbered files skip a number, because the clock would then be wrong."""
    if not all(p.stem.isdigit() for p in color):
        return
    step = np.diff([int(p.stem) for p in color])
    if len(step) == 0 or np.all(step == step[0]):
        return
    usual = int(np.median(step))
    k = int(np.flatnonzero(step != usual)[0])
    raise InputError(
        f"{files.shown(color[k])} is followed by {color[k + 1].name}: the numbering jumps by {step[k]}",
        "add the missing frames, or a timestamps.txt with the time of every frame that is there",
    )


def _intrinsics(path: Path, name: str) -> Intrinsics:
    if not (path / name).is_file():
        raise InputError(
            f"{path} has no {name}; it holds {files.listing(path)}",
            'write {"width", "height", "intrinsic_matrix": [fx, 0, 0, 0, fy, 0, cx, cy, 1]}',
        )
    return files.read_intrinsics(path / name)


class VideoFacts(NamedTuple):
    """What Open3D's videos note besides intrinsics: depth counts a metre, frames a second (or None)."""

    depth_per_metre: float
    fps: float | None


def video_facts(path: Path) -> VideoFacts:
    """`depth_scale` and `fps` of intrinsic.json, as open3d.t.io.RGBDVideoReader.save_frames writes them."""
    data = files.read_json(path / "intrinsic.json")
    found: dict[str, float] = {}
    for key in ("depth_scale", "fps"):
        value = data.get(key)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < np.inf:
            raise InputError(
                f"{files.shown(path / 'intrinsic.json')}: {key} is {value!r}",
                "write a positive number, or leave it out",
            )
        found[key] = float(value)
    return VideoFacts(found.get("depth_scale", DEPTH_PER_METRE), found.get("fps"))


def _times(path: Path, color: list[Path], fps: float | None) -> tuple[Array, tuple[str, ...]]:
    stamps = path / "timestamps.txt"
    if not stamps.is_file():
        _check_numbering(color)
        where = "assuming" if fps is None else "intrinsic.json says"
        fps = DEFAULT_FPS if fps is None else fps
        warning = f"{path.name} has no timestamps.txt: {where} {fps:g} frames per second"
        return np.arange(len(color)) / fps, (warning,)
    times = files.read_numbers(stamps, 1, "one time in seconds a line")[0][:, 0]
    if len(times) != len(color):
        raise InputError(
            f"{files.shown(stamps)} has {len(times)} times for {len(color)} frames", "write one time a frame"
        )
    return times, ()


def _poses(path: Path, times: Array) -> tuple[Array, Array] | None:
    """Times (n,) s and poses (n, 4, 4) of trajectory.txt, on the frames' clock; None without it."""
    file = path / "trajectory.txt"
    if not file.is_file():
        return None
    stamps, poses = files.read_tum_poses(file)
    if not (path / "timestamps.txt").is_file():
        if len(poses) != len(times):
            raise InputError(
                f"{files.shown(file)} has {len(poses)} poses for {len(times)} frames without time stamps",
                "write one pose a frame, or add timestamps.txt",
            )
        return times, poses
    half_frame = 0.5 * float(np.median(np.diff(times))) if len(times) >= MIN_FRAMES else 0.0
    if files.trajectory_at(stamps, poses, times, half_frame) is None:
        raise InputError(
            f"{files.shown(file)} runs from {stamps.min():.3f} to {stamps.max():.3f} s, the frames from "
            f"{times[0]:.3f} to {times[-1]:.3f} s",
            "use the clock of timestamps.txt",
        )
    return stamps, poses


def _metadata(path: Path) -> tuple[Array | None, dict[str, str]]:
    file = path / "metadata.json"
    if not file.is_file():
        return None, {}
    data = files.read_json(file)
    described = {k: str(data[k]) for k in ("description",) if k in data}
    if data.get("gravity_camera0") is None:
        return None, described
    try:
        gravity = np.array(data["gravity_camera0"], dtype=np.float64)
        ok = gravity.shape == (3,) and abs(float(np.linalg.norm(gravity)) - 1.0) < 0.01
    except (TypeError, ValueError):
        ok = False
    if not ok:
        raise InputError(
            f"{files.shown(file)}: gravity_camera0 is {data['gravity_camera0']}",
            "write a unit vector of three numbers that points down in the first camera's axes",
        )
    return gravity / np.linalg.norm(gravity), described


def _side_files(path: Path) -> list[Path]:
    names = ("intrinsic.json", "depth_intrinsic.json", "timestamps.txt", "trajectory.txt", "metadata.json")
    return [path / n for n in names if (path / n).is_file()]


def _color_reader(color: list[Path], intrinsics: Intrinsics) -> ReadColor:
    def read(index: int) -> NDArray[np.uint8]:
        image = files.decode_color(files.shown(color[index]), files.read_bytes(color[index]))
        _check_size(color[index], image.shape, intrinsics, "intrinsic.json")
        return image

    return read


def _rig(path: Path, color: Intrinsics) -> Rig:
    """One camera, or two in one place where depth has intrinsics of its own."""
    own = path / "depth_intrinsic.json"
    return Rig(Lens(color), Lens(files.read_intrinsics(own))) if own.is_file() else Rig.one(color)


def depth_reader(depth: list[Path], camera: Intrinsics, per_metre: float) -> ReadDepth:
    own = depth[0].parents[1] / "depth_intrinsic.json"
    name = own.name if own.is_file() else "intrinsic.json"

    def read(index: int) -> NDArray[np.float32]:
        metres = files.decode_depth(files.shown(depth[index]), files.read_bytes(depth[index]), per_metre)
        _check_size(depth[index], metres.shape, camera, name)
        return metres

    return read


def _check_size(file: Path, shape: tuple[int, ...], intrinsics: Intrinsics, name: str) -> None:
    if shape[:2] == (intrinsics.height, intrinsics.width):
        return
    remedy = "give the intrinsics of the images"
    if file.parent.name == "depth" and name == "intrinsic.json":
        remedy = "add depth_intrinsic.json when depth has a resolution of its own"
    raise InputError(
        f"{files.shown(file)} is {shape[1]}x{shape[0]}, {name} says {intrinsics.width}x{intrinsics.height}",
        remedy,
    )
