"""A small recording as a phone would make it: known poses, uneven steps of time, and pixels without depth."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import recon
from benchmarks.layouts.phones import (
    write_arkit_scenes,
    write_polycam,
    write_r3d,
    write_record3d_exr,
    write_scanner_app,
)
from recon.readers import Reader, open_recording
from recon.readers.arkit_scenes import ArkitScenesReader
from recon.readers.polycam import PolycamReader
from recon.readers.record3d import Record3DReader
from recon.readers.record3d_exr import Record3DExrReader
from recon.readers.scanner_app import ScannerAppReader
from recon.readers.streams import recording_of
from recon.recording import Recording
from tests.makers.recon.tiny import FRAMES, write_recording
from twin.errors import InputError

STEPS = (1 / 60, 1 / 30, 1 / 20)  # s, as phones mix them
START = 8123.25  # s since the phone was switched on
SIZE = (96, 72)  # of depth, that of colour where a test compares pixel by pixel
HOLE = np.s_[10:20, 30:50]  # pixels without depth

LAYOUTS: dict[str, tuple[Reader, Callable[..., Path]]] = {
    "record3d_exr": (Record3DExrReader(), write_record3d_exr),
    "polycam": (PolycamReader(), write_polycam),
    "scanner_app": (ScannerAppReader(), write_scanner_app),
    "arkit_scenes": (ArkitScenesReader(), write_arkit_scenes),
    "r3d": (Record3DReader(), write_r3d),
}


def refused(open_first: Callable[[], object], folder: Path, message: str) -> None:
    """What `open_first` does is refused in one line, short beside the folder's name."""
    with pytest.raises(InputError, match=message) as caught:
        open_first()
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).replace(str(folder), "PATH")) < 400


def opened(layout: str, folder: Path) -> Recording:
    reader = LAYOUTS[layout][0]
    assert reader.recognises(folder)
    return recording_of(reader.streams(folder))


def written_layouts(recording: recon.Recording, place: Path) -> dict[str, Path]:
    """A recording in each of `LAYOUTS`, depth as large as colour."""
    return {
        k: write(recording, place / (f"{k}.r3d" if k == "r3d" else k), SIZE)
        for k, (_, write) in LAYOUTS.items()
    }


def phone_recording(folder: Path) -> recon.Recording:
    """30 frames of 96x72 with poses of a z-up world."""
    clip = write_recording(folder)
    shutil.copy(clip / "truth" / "trajectory.txt", clip / "trajectory.txt")
    known = open_recording(clip)
    times = START + np.cumsum([STEPS[k % 3] for k in range(FRAMES)])

    def read_depth(index: int) -> np.ndarray:
        depth = known.depth(index).copy()
        depth[HOLE] = 0
        return depth

    return replace(known, times=times, read_depth=read_depth)


def altered_bytes(path: Path, count: int, seed: int = 3) -> Iterator[None]:
    """Changes a file `count` times, a bit or its length, and puts it back after each."""
    rng, whole = np.random.default_rng(seed), path.read_bytes()
    for k in range(count):
        data = bytearray(whole)
        if k % 10 == 0:
            data = data[: rng.integers(len(data))]
        else:
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        yield
    path.write_bytes(whole)


def same_pictures(
    found: recon.Recording, expected: recon.Recording, frames: dict[int, int] | None = None
) -> None:
    """Every frame of `found` shows what its partner in `expected` does, more than what that one's neighbours
    do."""
    for k, of in (frames or {k: k for k in range(len(found))}).items():
        off = [
            float(np.abs(found.color(k).astype(int) - expected.color(j)).mean())
            for j in range(max(of - 1, 0), min(of + 2, len(expected)))
        ]
        assert off[min(of, 1)] == min(off)
        assert off[min(of, 1)] < 2.5  # grey values, of a coded picture
