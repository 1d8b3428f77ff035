"""BundleSDF's layout: rgb/*.png, depth/*.png of the same names in millimetres, masks/*.png, cam_K.txt.

After the project's README and the mistakes that its users report most: depth of 8 bits, masks of three
channels, no cam_K.txt or one of another resolution, frames that are missing in one folder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.readers import files
from recon.readers.fingerprint import fingerprint
from recon.readers.pictures import PngHeader, camera_of, color_of, depth_of, pictures
from recon.readers.streams import Streams
from recon.recording import Intrinsics
from recon.recording.rig import Rig
from twin.errors import InputError

DEFAULT_FPS = 30.0  # chosen by us: the layout tells no times
# of a side, chosen by us: a principal point further from the middle is likely of another resolution
OFF_CENTRE = 0.15
_PAIRS = "give every frame one image in rgb/ and one of the same name in depth/"


@dataclass(frozen=True)
class BundleSdfReader:
    """Reads a folder for BundleSDF; masks are looked at, but not used."""

    layout: str = "a BundleSDF folder with rgb/, depth/ and cam_K.txt"

    def recognises(self, path: Path) -> bool:
        if not path.is_dir():
            return False
        if (path / "cam_K.txt").is_file():
            return True
        return all((path / n).is_dir() for n in ("rgb", "depth", "masks")) and not (
            (path / "intrinsic.json").is_file()
        )

    def streams(self, path: Path) -> Streams:
        color = pictures(path / "rgb", files.COLOR_SUFFIXES, "PNG images")
        depth = pictures(path / "depth", (".png",), "16-bit PNG depth images")
        _check_names(path, color, depth)
        height, width = color_of(color[0]).shape[:2]
        camera, warnings = _camera(path, width, height)
        times = np.arange(len(color)) / DEFAULT_FPS
        assumed = f"{path.name} tells no times; taken to be recorded at {DEFAULT_FPS:g} frames a second"
        return Streams(
            name=path.resolve().name,
            source=str(path),
            color_times=times,
            depth_times=times,
            read_color=lambda k: color_of(color[k]),
            read_depth=lambda k: depth_of(depth[k]),
            rig=Rig.one(camera),
            fingerprint=fingerprint(path, [*color, *depth, path / "cam_K.txt"]),
            warnings=(assumed, *warnings, *_masks(path, color)),
        )


def _check_names(path: Path, color: Sequence[Path], depth: Sequence[Path]) -> None:
    """Raise InputError when a frame has one image of the two."""
    first, second = {p.stem for p in color}, {p.stem for p in depth}
    alone = min(first ^ second, key=files.natural_key, default=None)
    if alone is not None:
        there, lacking = ("rgb", "depth") if alone in first else ("depth", "rgb")
        raise InputError(
            f"{files.shown(path)} has {len(color)} images in rgb/ and {len(depth)} in depth/; {there}/{alone} has none in "
            f"{lacking}/",
            _PAIRS,
        )
    if len(first) != len(color) or len(second) != len(depth):
        raise InputError(f"{files.shown(path)} has two images of one name in rgb/ or depth/", _PAIRS)


def _camera(path: Path, width: int, height: int) -> tuple[Intrinsics, tuple[str, ...]]:
    file = path / "cam_K.txt"
    if not file.is_file():
        raise InputError(
            f"{files.shown(path)} has no cam_K.txt; it holds {files.listing(path)}",
            "write the camera matrix: fx 0 cx, 0 fy cy, 0 0 1 in three lines",
        )
    table, _ = files.read_numbers(file, 3, "K: three lines of three numbers")
    camera = camera_of(table, width, height, files.shown(file))
    off = max(abs(camera.cx / width - 0.5), abs(camera.cy / height - 0.5))
    if off <= OFF_CENTRE:
        return camera, ()
    warning = (
        f"{file.name}: the principal point ({camera.cx:.1f}, {camera.cy:.1f}) is {off:.0%} of a side from the middle of the "
        f"{width}x{height} images: is it of another resolution?"
    )
    return camera, (warning,)


def _masks(path: Path, color: Sequence[Path]) -> tuple[str, ...]:
    """What is wrong with the masks, of which nothing here depends."""
    folder = path / "masks"
    masks = sorted(folder.glob("*.png"), key=files.natural_key) if folder.is_dir() else []
    if not masks:
        return ()
    head = PngHeader(masks[0])
    if head.channels != 1:
        return (
            f"masks/{masks[0].name} has {head.channels} channels, a mask has one; masks are not used here",
        )
    if len(masks) != len(color):
        return (f"masks/ holds {len(masks)} masks for {len(color)} images; masks are not used here",)
    return ()
