"""Azure Kinect recordings (.mkv), as k4arecorder, k4aviewer and the SDK's recording library write them.

Tracks COLOR and DEPTH of a Matroska file, the device's calibration as its attachment, and tags that begin
with K4A_. No SDK is needed. Depth is the distance along the view (not along the ray) in 16-bit big-endian
millimetres, as the depth camera sees it.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.readers import files
from recon.readers.encoded import picture_size
from recon.readers.fingerprint import fingerprint_of
from recon.readers.kinect.calibration import rig_of
from recon.readers.kinect.matroska import Contents, Frames, Track, read_contents
from recon.readers.streams import Streams
from recon.recording import ReadColor, ReadDepth
from twin.errors import InputError
from twin.geometry import Array

RECORDER_SCALE = 1000  # ns a tick: what the recorder counts in, and writes down when it closes the file
MAX_DELAY = 0.005  # s, chosen by us: what moves at 1 m/s is then 5 mm further in depth than in colour
MAX_CALIBRATION_BYTES = 2**20  # chosen by us: a device's has 4 to 10 kB
MAX_PICTURE_BYTES = 64 * 2**20  # chosen by us: 4096x3072 pixels of 32 bits are 48 MB
MAX_SIDE = 4096  # px, the colour sensor's width
DEPTH_TYPES = {"b16g": ">u2", "YUY2": "<u2"}  # YUY2 stood for little-endian depth in early recordings
RAW_BITS = {"NV12": 12, "YUY2": 16, "BGRA": 32}  # of a pixel
PACKED = ("MJPG", "MPNG")  # the recorder's own, and lossless copies
_AGAIN = "record again, e.g. k4arecorder -c 720p -d NFOV_UNBINNED -r 30 FILE.mkv"
_AS_WRITTEN = "give the recording as the recorder wrote it"


@dataclass(frozen=True)
class AzureKinectReader:
    """Reads a .mkv of an Azure Kinect; lenses are undistorted and depth registered by its calibration."""

    layout: str = "an Azure Kinect recording .mkv"

    def recognises(self, path: Path) -> bool:
        try:
            found = read_contents(path, head_only=True) if path.is_file() else None
        except InputError:
            return False
        if found is None:
            return False
        tracks = {t.name for t in found.tracks}
        calibrated = any(a.name == "calibration.json" for a in found.attachments)
        tagged = any(t.name.startswith("K4A_") for t in found.tags)
        return (
            tagged or {"COLOR", "DEPTH"} <= tracks or (calibrated and bool({"COLOR", "DEPTH", "IR"} & tracks))
        )

    def streams(self, path: Path) -> Streams:
        found, name = read_contents(path), files.shown(path)
        if not any(len(f.ticks) for f in found.frames.values()):
            where = (
                f", cut off or damaged at byte {found.whole_until}" if found.whole_until < found.size else ""
            )
            raise InputError(f"{name} holds no pictures ({found.size} bytes{where})", _AGAIN)
        color = _track(found, name, "COLOR", (*PACKED, *RAW_BITS))
        depth = _track(found, name, "DEPTH", DEPTH_TYPES)
        rig = rig_of(
            _calibration(path, found), name, (color.width, color.height), (depth.width, depth.height)
        )
        colors, depths = (_frames(found, name, t) for t in (color, depth))
        delay = _delay(found, name)
        modes = {key: found.tag(f"K4A_{key.upper()}") for key in ("color_mode", "depth_mode")}
        return Streams(
            name=path.stem,
            source=str(path),
            color_times=_seconds(found, colors),
            depth_times=_seconds(found, depths) - delay,
            read_color=_color_reader(path, color, colors),
            read_depth=_depth_reader(path, depth, depths),
            rig=rig,
            fingerprint=fingerprint_of(path),
            warnings=_warnings(path.name, found, delay),
            metadata={key: tag.value for key, tag in modes.items() if tag},
        )


def _track(found: Contents, name: str, kind: str, formats: Collection[str]) -> Track:
    """The track of tag K4A_<kind>_TRACK, else of that name. Raises InputError when it can't be read."""
    tag = found.tag(f"K4A_{kind}_TRACK")
    uids = () if tag is None else tag.uids
    track = next((t for t in found.tracks if t.uid in uids), None)
    track = track or next((t for t in found.tracks if t.name == kind), None)
    if track is None:
        mode = found.tag("K4A_DEPTH_MODE")
        why = f"{'depth' if kind == 'DEPTH' else 'colour'} was off when it was recorded"
        if kind == "DEPTH" and mode is not None and mode.value == "PASSIVE_IR":
            why = "its mode PASSIVE_IR records infrared without depth"
        raise InputError(f"{name} has no track {kind}: {why}", _AGAIN)
    if track.encoding:
        raise InputError(f"{name}: track {kind} is stored with {track.encoding}", _AS_WRITTEN)
    if _format(track) not in formats:
        known = ", ".join(formats)
        raise InputError(f"{name}: track {kind} is stored as {_format(track)!r}, not {known}", _AS_WRITTEN)
    if not (0 < track.width <= MAX_SIDE and 0 < track.height <= MAX_SIDE):
        raise InputError(f"{name}: track {kind} has pictures of {track.width}x{track.height}", _AGAIN)
    return track


def _format(track: Track) -> str:
    """FourCC of a track's pictures, of its BITMAPINFOHEADER; copying tools name JPEG otherwise."""
    if track.codec == "V_MS/VFW/FOURCC":
        return track.private[16:20].decode("ascii", "replace")
    return "MJPG" if track.codec == "V_MJPEG" else track.codec


def _frames(found: Contents, name: str, track: Track) -> Frames:
    frames = found.frames[track.number]
    if len(frames.ticks) == 0:
        raise InputError(f"{name} holds no picture of track {track.name[:40]!r}", _AGAIN)
    if frames.laced.any():
        k = int(np.flatnonzero(frames.laced)[0])
        raise InputError(
            f"{name}: picture {k} of track {track.name[:40]!r} is laced with others", _AS_WRITTEN
        )
    return frames


def _seconds(found: Contents, frames: Frames) -> Array:
    return frames.ticks * (RECORDER_SCALE if found.scale is None else found.scale) / 1e9


def _delay(found: Contents, name: str) -> float:
    """s that depth was taken after colour on purpose; the time stamps of both are of when they were taken."""
    tag = found.tag("K4A_DEPTH_DELAY_NS")
    if tag is None:
        return 0.0
    if not re.fullmatch("[+-]?[0-9]{1,10}", tag.value):
        raise InputError(f"{name}: tag K4A_DEPTH_DELAY_NS is {tag.value[:40]!r}", "write it in nanoseconds")
    return int(tag.value) * 1e-9


def _warnings(name: str, found: Contents, delay: float) -> tuple[str, ...]:
    said = []
    if found.whole_until < found.size:
        where = f"byte {found.whole_until} of {found.size}"
        said.append(f"{name}: cut off or damaged at {where}; the frames after it are left out")
    if found.scale is None:
        said.append(f"{name}: the recorder did not close it; its time stamps are taken as microseconds")
    if abs(delay) > MAX_DELAY:
        ms = 1000 * delay
        said.append(f"{name}: depth was recorded {ms:.1f} ms after colour, so what moves is not in one place")
    return tuple(said)


def _calibration(path: Path, found: Contents) -> bytes:
    """The attachment that the tag K4A_CALIBRATION_FILE tells, else the one named calibration.json."""
    tag, name = found.tag("K4A_CALIBRATION_FILE"), files.shown(path)
    uids = () if tag is None else tag.uids
    kept = next((a for a in found.attachments if a.uid in uids), None)
    kept = kept or next((a for a in found.attachments if a.name == "calibration.json"), None)
    if kept is None:
        raise InputError(
            f"{name} has no attachment calibration.json",
            "attach the device's: mkvpropedit FILE.mkv --add-attachment calibration.json",
        )
    return _bytes(path, kept.start, kept.size, MAX_CALIBRATION_BYTES, f"{name}: calibration.json")


def _bytes(path: Path, start: int, size: int, limit: int, what: str) -> bytes:
    if size > limit:
        raise InputError(f"{what} has {size} bytes, more than {limit}", "don't trust this file")
    try:
        with path.open("rb") as stream:
            stream.seek(start)
            data = stream.read(size)
    except OSError as error:
        raise InputError(f"{what} can't be read ({error.strerror})", "copy the recording again") from None
    if len(data) < size or size == 0:
        raise InputError(f"{what} has {len(data)} of {size} bytes", "copy the recording again")
    return data


def _picture(path: Path, track: Track, frames: Frames, index: int) -> tuple[str, bytes]:
    """Its name for messages, and its bytes."""
    what = f"{files.shown(path)}: picture {index} of track {track.name[:40]!r}"
    data = _bytes(path, int(frames.starts[index]), int(frames.sizes[index]), MAX_PICTURE_BYTES, what)
    return what, track.prefix + data


def _raw(what: str, track: Track, data: bytes, bits: int) -> NDArray[np.uint8]:
    """Bytes of a picture whose pixels have that many bits each."""
    expected = track.width * track.height * bits // 8
    if len(data) != expected or (bits == RAW_BITS["NV12"] and track.height % 2):  # two rows share a colour
        raise InputError(
            f"{what} has {len(data)} bytes, {track.width}x{track.height} {_format(track)} have {expected}",
            "copy the recording again",
        )
    return np.frombuffer(data, np.uint8)


def _depth_reader(path: Path, track: Track, frames: Frames) -> ReadDepth:
    order = DEPTH_TYPES[_format(track)]

    def read(index: int) -> NDArray[np.float32]:
        what, data = _picture(path, track, frames, index)
        raw = _raw(what, track, data, 16)
        return (raw.view(order).reshape(track.height, track.width) / np.float32(1000)).astype(np.float32)

    return read


def _color_reader(path: Path, track: Track, frames: Frames) -> ReadColor:
    import cv2  # here: what is wrong with a recording is told without it

    format_ = _format(track)

    def read(index: int) -> NDArray[np.uint8]:
        what, data = _picture(path, track, frames, index)
        if format_ in PACKED:
            _require_size(what, data, track)
            return files.decode_color(what, data)
        raw = _raw(what, track, data, RAW_BITS[format_])
        if format_ == "BGRA":
            return np.ascontiguousarray(raw.reshape(track.height, track.width, 4)[..., 2::-1])
        if format_ == "NV12":
            planes = raw.reshape(track.height * 3 // 2, track.width)
            return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YUV2RGB_NV12), dtype=np.uint8)
        pairs = raw.reshape(track.height, track.width, 2)
        return np.asarray(cv2.cvtColor(pairs, cv2.COLOR_YUV2RGB_YUY2), dtype=np.uint8)

    return read


def _require_size(what: str, data: bytes, track: Track) -> None:
    """Raise InputError before decoding a picture that claims another size: decoders allocate what it says."""
    size = picture_size(data)
    if size != (track.width, track.height):
        said = f"is {size[0]}x{size[1]}" if any(size) else "says no size"
        raise InputError(
            f"{what} {said}, its track {track.width}x{track.height} ({len(data)} bytes)",
            "copy the recording again",
        )
