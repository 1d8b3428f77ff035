"""A folder with one colour video beside depth/ of 16-bit PNGs in mm, one for each of the video's frames."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from recon.readers import arkit, files
from recon.readers.fingerprint import fingerprint
from recon.readers.native import COLOR_FOLDERS, depth_reader, video_facts
from recon.readers.streams import Streams
from recon.readers.video import VIDEO_SUFFIXES, Video
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

MAX_COUNT_DIFFERENCE = 1  # chosen by us: recorders stop colour and depth one after the other
_SIDE_FILES = ("intrinsic.json", "depth_intrinsic.json", "timestamps.txt", "trajectory.txt")


@dataclass(frozen=True)
class VideoFolderReader:
    """Reads a video with the depth images, intrinsics and optional files of the native layout beside it."""

    layout: str = "a folder with one video (mp4, mov, mkv, avi), depth/ (16-bit PNG in mm) and intrinsic.json"

    def recognises(self, path: Path) -> bool:
        with suppress(OSError):
            if not (path / "depth").is_dir() or any((path / n).is_dir() for n in COLOR_FOLDERS):
                return False
            return bool(_videos(path))
        return False

    def streams(self, path: Path) -> Streams:
        found = _videos(path) if path.is_dir() else []
        if len(found) != 1:
            names = ", ".join(p.name for p in found[:4])
            raise InputError(
                f"{path} holds {len(found)} videos{': ' + names if names else ''}",
                "keep the one that belongs to depth/",
            )
        depth = sorted(
            (p for p in (path / "depth").glob("*") if p.suffix.lower() == ".png"), key=files.natural_key
        )
        if not depth:
            raise InputError(
                f"{files.shown(path / 'depth')} holds no PNG", "put 16-bit PNG depth images in mm there"
            )
        if not (path / "intrinsic.json").is_file():
            raise InputError(
                f"{path} has no intrinsic.json; it holds {files.listing(path)}",
                'write {"width", "height", "intrinsic_matrix": [fx, 0, 0, 0, fy, 0, cx, cy, 1]} of the video',
            )
        video = Video(found[0])
        count, warnings = _common(path, video, len(depth))
        times = _times(path, video, count, max(len(video), len(depth)))
        size = arkit.png_size(depth[0])
        rig = _rig(path, video, size)
        trajectory = path / "trajectory.txt"
        sides = [path / n for n in _SIDE_FILES if (path / n).is_file()]
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=times,
            depth_times=times,
            read_color=video.read,
            read_depth=depth_reader(depth, rig.depth.camera, video_facts(path).depth_per_metre),
            rig=rig,
            fingerprint=fingerprint(path, [video.path, *depth, *sides]),
            poses=files.read_tum_poses(trajectory) if trajectory.is_file() else None,
            warnings=warnings,
        )


def _videos(path: Path) -> list[Path]:
    return sorted(p for p in path.iterdir() if p.suffix.lower() in VIDEO_SUFFIXES and p.is_file())


def _common(path: Path, video: Video, depth: int) -> tuple[int, tuple[str, ...]]:
    """How many frames the video and depth/ share from the first on."""
    if abs(len(video) - depth) > MAX_COUNT_DIFFERENCE:
        raise InputError(
            f"{files.shown(video.path)} holds {len(video)} frames, depth/ {depth} images",
            "keep exactly one depth image for every frame of the video",
        )
    if len(video) == depth:
        return depth, ()
    return min(len(video), depth), (
        f"{path.name}: {video.path.name} holds {len(video)} frames, depth/ {depth} images: the last one is left out",
    )


def _times(path: Path, video: Video, count: int, most: int) -> Array:
    """Times (count,) s of timestamps.txt, else those at which the video shows its frames."""
    stamps = path / "timestamps.txt"
    if not stamps.is_file():
        return video.times[:count]
    times = files.read_numbers(stamps, 1, "one time in seconds a line")[0][:, 0]
    if not count <= len(times) <= most:
        raise InputError(
            f"{files.shown(stamps)} has {len(times)} times for {count} frames", "write one time a frame"
        )
    return times[:count]


def _rig(path: Path, video: Video, depth_size: tuple[int, int]) -> Rig:
    color = files.read_intrinsics(path / "intrinsic.json")
    _require_size(video.path.name, (video.width, video.height), color, "intrinsic.json")
    own = path / "depth_intrinsic.json"
    if not own.is_file():
        _require_size("depth/", depth_size, color, "intrinsic.json")
        return Rig.one(color)
    depth = files.read_intrinsics(own)
    _require_size("depth/", depth_size, depth, own.name)
    return Rig(Lens(color), Lens(depth))


def _require_size(what: str, size: tuple[int, int], camera: Intrinsics, name: str) -> None:
    if size == (camera.width, camera.height):
        return
    remedy = "give the intrinsics of the frames as they are stored"
    if size == (camera.height, camera.width):
        remedy += "; a flag that turns them for display is not followed"
    elif what == "depth/" and name == "intrinsic.json":
        remedy = "add depth_intrinsic.json when depth has a resolution of its own"
    raise InputError(f"{what} is {size[0]}x{size[1]}, {name} says {camera.width}x{camera.height}", remedy)
