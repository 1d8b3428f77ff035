"""HOI4D clips: ZY.../H*/C*/N*/S*/s*/T*/ with align_rgb/ and align_depth/, as its decode.py leaves them.

After the data set's instructions: 1920x1080 colour (image.mp4, or images %05d.jpg at 15 frames a second),
depth as 16-bit PNG in millimetres on colour's pixels, K in camera_params/<ZY...>/intrin.npy, and among the
annotations 3Dseg/output.log, Redwood's list of camera-to-world matrices, one a frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import files
from recon.readers.numpy_files import read_npy
from recon.readers.pictures import (
    PngHeader,
    camera_of,
    color_of,
    depth_of,
    numbers,
    pictures,
    rigid,
    tree_fingerprint,
)
from recon.readers.streams import Streams
from recon.recording import Intrinsics, ReadColor
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

FPS = 15.0  # of decode.py's images and of the annotations
DECODE = "decode the clip with HOI4D's utils/decode.py"
_CAMERA = re.compile(r"ZY\d+")
_ANNOTATIONS = ("HOI4D_annotations", "annotations", "annotations/HOI4D_annotations")
_UP = 4  # folders above the camera's in which its parameters and annotations are looked for; chosen by us


@dataclass(frozen=True)
class Hoi4dReader:
    """Reads a clip's folder. Frames are counted by the numbers in the images' names."""

    layout: str = "a HOI4D clip with align_rgb/ and align_depth/"

    def recognises(self, path: Path) -> bool:
        return path.is_dir() and ((path / "align_rgb").is_dir() or (path / "align_depth").is_dir())

    def streams(self, path: Path) -> Streams:
        depth = _depth_files(path)
        color_times, read_color, width, height, sources = _color(path)
        camera, camera_file = _intrinsics(path, width, height)
        first = PngHeader(depth[0])
        log = next((p for f in clip_folders(path) if (p := f / "3Dseg" / "output.log").is_file()), None)
        poses = None if log is None else read_redwood_log(log)
        if (first.width, first.height) == (width, height):
            rig = Rig.one(camera)
        elif first.width * height == first.height * width:
            rig = Rig(Lens(camera), Lens(camera.scaled(first.width, first.height)))
        else:
            raise InputError(
                f"{files.shown(depth[0])} is {first.width}x{first.height}, colour {width}x{height}", DECODE
            )
        inputs = [*sources, *depth, camera_file, *([] if log is None else [log])]
        return Streams(
            name=clip_name(path),
            source=str(path),
            color_times=color_times,
            depth_times=numbers(depth) / FPS,
            read_color=read_color,
            read_depth=lambda k: depth_of(depth[k]),
            rig=rig,
            fingerprint=tree_fingerprint(path, inputs),
            poses=None if poses is None else (np.arange(len(poses)) / FPS, poses),
        )


def clip_name(path: Path) -> str:
    """The pieces of the clip's path from its camera on, which name it within the data set."""
    parts = path.resolve().parts
    at = next((k for k, p in enumerate(parts) if _CAMERA.fullmatch(p)), len(parts) - 1)
    return "_".join(parts[at:])


def clip_folders(path: Path) -> Iterator[Path]:
    """The clip's folder, then the folders where a tree of annotations beside the data has this clip."""
    yield path
    parts = path.resolve().parts
    at = next((k for k, p in enumerate(parts) if _CAMERA.fullmatch(p)), None)
    if at is None:
        return
    for up in range(at, max(0, at - _UP), -1):
        for name in _ANNOTATIONS:
            yield Path(*parts[:up], *name.split("/"), *parts[at:])


def read_redwood_log(path: Path) -> Array:
    """T_world_cam (n, 4, 4) of a Redwood log: a line of three numbers and four matrix rows a camera."""
    lines = files.read_lines(path)
    rows = []
    for at in range(0, len(lines), 5):
        block = lines[at : at + 5]
        try:
            if len(block) != 5 or len(block[0][1]) != 3 or any(len(words) != 4 for _, words in block[1:]):
                raise ValueError
            rows.append([[float(w) for w in words] for _, words in block[1:]])
        except ValueError:
            raise InputError(
                f"{files.shown(path)} line {block[0][0]} begins no pose of three numbers and 4 x 4 numbers",
                "copy the annotations again",
            ) from None
    if not rows:
        raise InputError(f"{files.shown(path)} holds no pose", "copy the annotations again")
    return rigid(rows, files.shown(path))


def _depth_files(path: Path) -> list[Path]:
    folder = path / "align_depth"
    video = folder / "depth_video.avi"
    if video.is_file() and not any(folder.glob("*.png")):
        raise InputError(
            f"{files.shown(video)} is depth packed as video, which a plain decoder changes",
            f"{DECODE}, which writes align_depth/00000.png and so on",
        )
    return pictures(folder, (".png",), "16-bit PNG depth images")


def _color(path: Path) -> tuple[Array, ReadColor, int, int, list[Path]]:
    """Times, reader, width, height and files of colour: images where decode.py wrote some, else the video."""
    folder, video = path / "align_rgb", path / "align_rgb" / "image.mp4"
    if video.is_file() and not any(p.suffix.lower() in files.COLOR_SUFFIXES for p in folder.iterdir()):
        from recon.readers.video import Video  # here: it takes a decoder's library

        clip = Video(video)
        return clip.times - clip.times[0], clip.read, clip.width, clip.height, [video]
    found = pictures(folder, files.COLOR_SUFFIXES, "JPEG or PNG images")
    height, width = color_of(found[0]).shape[:2]
    return numbers(found) / FPS, lambda k: color_of(found[k]), width, height, found


def _intrinsics(path: Path, width: int, height: int) -> tuple[Intrinsics, Path]:
    """The camera and the file that tells it."""
    own = path / "intrinsic.json"
    if own.is_file():
        told = files.read_intrinsics(own)
        camera = camera_of(told.matrix, told.width, told.height, files.shown(own))
        return camera if (camera.width, camera.height) == (width, height) else camera.scaled(
            width, height
        ), own
    file = next((p for p in _camera_files(path) if p.is_file()), None)
    if file is None:
        camera_id = next((p for p in path.resolve().parts if _CAMERA.fullmatch(p)), "ZY...")
        raise InputError(
            f"{files.shown(path)} has no intrinsics: no camera_params/{camera_id}/intrin.npy in the folders above",
            "put HOI4D's camera_params/ beside its clips, or intrin.npy or intrinsic.json into the clip",
        )
    K = read_npy(file, most=2**16)
    return camera_of(
        K.reshape(K.shape[-2:]) if K.size == 9 and K.ndim > 2 else K, width, height, files.shown(file)
    ), file


def _camera_files(path: Path) -> Iterator[Path]:
    yield path / "intrin.npy"
    resolved = path.resolve()
    camera = next((p for p in resolved.parts if _CAMERA.fullmatch(p)), None)
    for parent in resolved.parents:
        if camera is not None:
            yield parent / "camera_params" / camera / "intrin.npy"
            yield parent / "camera_params" / "camera_params" / camera / "intrin.npy"
        if parent.name == camera:
            yield parent / "intrin.npy"
