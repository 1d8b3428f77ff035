"""Readers: one file per recording layout, and the table that finds the right one.

To add a layout, write a class with `layout`, `recognises` and `streams`, and put an instance of it into
`READERS`. Formats that are recognised but not read stand in `unread.UNREAD` with what to do about them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from recon.readers.arkit_scenes import ArkitScenesReader
from recon.readers.arti4d import Arti4dReader
from recon.readers.bundlesdf import BundleSdfReader
from recon.readers.calibration.file import Calibration, calibrated, read_calibration
from recon.readers.files import listing
from recon.readers.hoi4d import Hoi4dReader
from recon.readers.itaco import ItacoReader
from recon.readers.kinect import AzureKinectReader
from recon.readers.native import NativeReader
from recon.readers.polycam import PolycamReader
from recon.readers.record3d import Record3DReader
from recon.readers.record3d_exr import Record3DExrReader
from recon.readers.ros import RosReader
from recon.readers.scanner_app import ScannerAppReader
from recon.readers.scannet import ScanNetReader
from recon.readers.stray_scanner import StrayScannerReader
from recon.readers.streams import Streams, recording_of
from recon.readers.tum import TumReader
from recon.readers.unread import (
    LOOKED_AT,
    UNREAD,
    refuse_colour_alone,
    refuse_named,
    refuse_unread,
    refuse_unread_inside,
)
from recon.readers.video_folder import VideoFolderReader
from recon.recording import Recording
from twin.errors import InputError, nearest_name

__all__ = ["READERS", "UNREAD", "Reader", "open_recording"]


class Reader(Protocol):
    """One recording layout."""

    @property
    def layout(self) -> str:
        """One line that tells what the layout looks like."""
        ...

    def recognises(self, path: Path) -> bool:
        """Whether the path looks like this layout; quick, never raises for an existing path."""
        ...

    def streams(self, path: Path) -> Streams:
        """What the files hold by headers and index. InputError names file, value and remedy."""
        ...


# The first one that recognises a path opens it: the native layout is the most general and comes last.
READERS: dict[str, Reader] = {
    "record3d": Record3DReader(),
    "itaco": ItacoReader(),
    "record3d_exr": Record3DExrReader(),
    "stray_scanner": StrayScannerReader(),
    "polycam": PolycamReader(),
    "scanner_app": ScannerAppReader(),
    "azure_kinect": AzureKinectReader(),
    "ros": RosReader(),
    "scannet": ScanNetReader(),
    "arkit_scenes": ArkitScenesReader(),
    "hoi4d": Hoi4dReader(),
    "arti4d": Arti4dReader(),
    "bundlesdf": BundleSdfReader(),
    "tum": TumReader(),
    "video_folder": VideoFolderReader(),
    "native": NativeReader(),
}


def open_recording(
    path: Path | str,
    layout: str | None = None,
    *,
    calibration: Path | str | None = None,
    color_topic: str | None = None,
    depth_topic: str | None = None,
    depth_delay: int | str | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Recording:
    """Open a recording; its first frame is decoded, the others when they are asked for.

    Args:
        path: folder or file.
        layout: name of a reader in `READERS`; None takes the first that recognises the path.
        calibration: file of `twin calibrate`, whose cameras go before the recording's own.
        color_topic: of a ROS bag that holds several.
        depth_topic: likewise.
        depth_delay: by how much depth lags behind colour, frames or a time such as "66ms"; see
            `Recording.without_depth_delay`.
        start: s from the first frame; frames before are left out.
        end: s from the first frame; frames after are left out.

    Raises InputError for a path that does not exist, an unknown layout name, a format that is recognised but
    not read (it says what to do), or a layout nobody recognises.
    """
    path = Path(path)
    if layout is not None and layout not in READERS:
        near = nearest_name(layout, list(READERS))
        raise InputError(
            f"there is no recording layout {layout!r}",
            (f"did you mean {near!r}? " if near else "") + f"known: {', '.join(READERS)}",
        )
    if not path.exists():
        raise InputError(f"recording {path} does not exist", "check the path")
    if not os.access(path, os.R_OK | os.X_OK if path.is_dir() else os.R_OK):
        raise InputError(f"recording {path} can't be read", "change its permissions, or copy it")
    topics = {k: v for k, v in (("color_topic", color_topic), ("depth_topic", depth_topic)) if v is not None}
    cameras = None if calibration is None else read_calibration(Path(calibration))
    reader = _asked(_reader(path, layout), topics, cameras)
    try:
        streams = reader.streams(path)
    except (NotADirectoryError, IsADirectoryError):  # a layout named in vain
        kind = "folder" if path.is_dir() else "file"
        raise InputError(f"{path} is a {kind} and not {reader.layout}", "leave --layout out") from None
    if cameras is not None:
        streams = calibrated(streams, cameras)
    recording = recording_of(streams)
    if depth_delay is not None:
        recording = recording.without_depth_delay(depth_delay)
    recording = _between(recording, start, end)
    _require_depth(recording)
    options: dict[str, Any] = {"layout": layout, "calibration": calibration, **topics}
    options |= {"depth_delay": depth_delay, "start": start, "end": end}
    said = {k: os.fspath(v) if isinstance(v, Path) else v for k, v in options.items() if v is not None}
    return replace(recording, path=path, opened_with=said)


def _asked(reader: Reader, topics: Mapping[str, str], cameras: Calibration | None) -> Reader:
    """The reader, told which topics to take and what it need not find."""
    if isinstance(reader, RosReader):
        return replace(reader, calibrated=frozenset() if cameras is None else cameras.contents, **topics)
    if topics:
        names = " and ".join(f"--{t.replace('_', '-')}" for t in topics)
        raise InputError(f"{names}: topics are of ROS bags, and this is none", "leave that out")
    return reader


def _require_depth(recording: Recording) -> None:
    """Decode the first frame, so that a wrong type or size is told before anything is computed. Raises
    InputError where neither it nor the middle or the last frame has any depth: a lens may be covered once."""
    if recording.frame(0).depth.any():
        return
    if not any(recording.depth(k).any() for k in (len(recording) // 2, len(recording) - 1)):
        raise InputError(
            f"{recording.source} holds no depth: all pixels of its first, middle and last frame are 0",
            "record again with the depth camera on, and uncovered",
        )


def _between(recording: Recording, start: float | None, end: float | None) -> Recording:
    """The frames from `start` to `end` s after the first one."""
    if start is None and end is None:
        return recording
    first, last = 0.0 if start is None else start, np.inf if end is None else end
    length = float(recording.times[-1] - recording.times[0])
    if not 0.0 <= first < last or first > length:
        raise InputError(
            f"from {first:g} to {last:g} s is no part of {recording.source}, which lasts {length:.3f} s",
            "give times from its first frame on, the first before the last",
        )
    since = recording.times - recording.times[0]
    # times are differences of large stamps: a frame at the border is in
    kept = np.flatnonzero((since >= first - 1e-6) & (since <= last + 1e-6))
    return recording[int(kept[0]) : int(kept[-1]) + 1] if len(kept) else recording[:0]


def _reader(path: Path, layout: str | None) -> Reader:
    if layout is not None:
        return READERS[layout]
    if (path / "intrinsic.json").is_file() and (path / "color").is_dir():
        return READERS["native"]  # converted, beside what it was made from
    refuse_named(path)
    for name, reader in READERS.items():
        if name == "native":
            refuse_unread(path)
        if reader.recognises(path):
            return reader
    _say_inside(path)
    refuse_unread_inside(path)
    refuse_colour_alone(path)
    there = f"it holds {listing(path)}" if path.is_dir() else f"a file of {path.stat().st_size} bytes"
    raise InputError(
        f"{path} is no recording known here ({there})", f"known layouts, for --layout: {', '.join(READERS)}"
    )


def _say_inside(folder: Path) -> None:
    """Raise InputError that names the recording that a folder holds."""
    for inside in sorted(folder.iterdir())[:LOOKED_AT] if folder.is_dir() else []:
        for name, reader in READERS.items():
            if reader.recognises(inside) and (name != "native" or (inside / "intrinsic.json").is_file()):
                raise InputError(
                    f"{folder} is no recording, but holds {inside.name} ({name})", f"give {inside}"
                )
