"""Write a recording as an Azure Kinect's recorder does: a .mkv with tracks COLOR and DEPTH, its calibration
and its tags.

The pieces of the file (elements, tracks, tags, captures) are functions of their own, so that tests can put
files together that no recorder writes. FFmpeg can't write the depth track's FourCC, so the elements are
written here.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import recon
from recon.recording import Intrinsics
from twin.errors import InputError

DEPTH_SIZE = (640, 576)  # mode NFOV_UNBINNED, cut from the sensor's 1024x1024 at (192, 180)
UIDS = {"COLOR": 101, "DEPTH": 102, "calibration.json": 103}
BITS = {"MPNG": 24, "MJPG": 24, "BGRA": 32, "NV12": 12, "YUY2": 16, "b16g": 16}
UNKNOWN = b"\x01" + 7 * b"\xff"


def write_azure_kinect(
    recording: recon.Recording,
    out: Path,
    color: str = "MPNG",
    delay: float = 0.0,
    live: bool = False,
) -> Path:
    """Write a recording whose depth is registered and at most 640x576, and whose colour is 4:3 or 16:9.

    Args:
        color: FourCC. MPNG and BGRA are lossless; MJPG, NV12 and YUY2 are a device's.
        delay: s by which depth is stamped later than colour, as with a depth delay.
        live: as a file whose recorder still runs: nothing has a size before it ends.

    Depth lies in the middle of a 640x576 picture, in whole mm; both cameras stand in one place and have no
    distortion.
    """
    k = recording.intrinsics
    if k.width > DEPTH_SIZE[0] or k.height > DEPTH_SIZE[1]:
        raise InputError(f"depth of {k.width}x{k.height} does not fit into {DEPTH_SIZE}", "scale it down")
    entries = [
        track(1, UIDS["COLOR"], "COLOR", color, k.width, k.height),
        track(2, UIDS["DEPTH"], "DEPTH", "b16g", *DEPTH_SIZE),
    ]
    tags = [
        tag("K4A_COLOR_TRACK", str(UIDS["COLOR"]), UIDS["COLOR"]),
        tag("K4A_COLOR_MODE", f"{color}_{k.height}P", UIDS["COLOR"]),
        tag("K4A_DEPTH_TRACK", str(UIDS["DEPTH"]), UIDS["DEPTH"]),
        tag("K4A_DEPTH_MODE", "NFOV_UNBINNED", UIDS["DEPTH"]),
        tag("K4A_DEPTH_DELAY_NS", str(round(1e9 * delay))),
        tag("K4A_CALIBRATION_FILE", "calibration.json", attachment=UIDS["calibration.json"]),
        tag("K4A_START_OFFSET_NS", str(round(1e9 * recording.times[0]))),
    ]
    with out.open("wb") as file:
        file.write(head(entries, json.dumps(calibration_of(k)).encode(), tags))
        for tick, pictures in captures(recording, color, delay):
            file.write(cluster(tick, pictures, live))
        if not live:
            size = file.tell() - segment_start()
            file.seek(segment_start() - 8)
            file.write(b"\x01" + size.to_bytes(7))
    return out


def captures(
    recording: recon.Recording, color: str, delay: float
) -> Iterator[tuple[int, list[tuple[int, int, bytes]]]]:
    """Clusters in the order of their ticks (us from the first picture): pictures that were taken at once."""
    at: dict[int, list[tuple[int, int]]] = {}
    for k, t in enumerate(recording.times):
        for index, after in ((1, 0.0), (2, delay)):
            at.setdefault(round(1e6 * (t + after)), []).append((index, k))
    for tick in sorted(at):
        pictures = [
            (i, 0, pack_color(recording.color(k), color) if i == 1 else pack_depth(recording.depth(k)))
            for i, k in at[tick]
        ]
        yield tick - min(at), pictures


def element(name: int, content: bytes = b"", size: bytes | None = None) -> bytes:
    """One element; size: instead of the content's own."""
    n = len(content)
    own = bytes([0x80 | n]) if n < 0x7F else b"\x01" + n.to_bytes(7)
    return name.to_bytes((name.bit_length() + 7) // 8) + (own if size is None else size) + content


def number(name: int, value: int) -> bytes:
    return element(name, value.to_bytes(max(1, (value.bit_length() + 7) // 8)))


def ebml_header() -> bytes:
    return element(0x1A45DFA3, element(0x4282, b"matroska") + number(0x4287, 2) + number(0x4285, 2))


def segment_start() -> int:
    """Where the content of the segment begins."""
    return len(ebml_header()) + 4 + 8


def head(
    entries: Sequence[bytes], calibration: bytes | None, tags: Sequence[bytes], scale: int = 1000
) -> bytes:
    """A file as far as its first cluster; scale: ns a tick, 0 for a file that its recorder has not closed."""
    parts = [element(0xEC, bytes(200))]  # the recorder keeps room for what it knows in the end
    if scale:
        parts.append(element(0x1549A966, number(0x2AD7B1, scale) + element(0x7BA9, b"Azure Kinect")))
    parts.append(element(0x1654AE6B, b"".join(entries)))
    if calibration is not None:
        kept = element(0x466E, b"calibration.json") + element(0x4660, b"application/octet-stream")
        kept += number(0x46AE, UIDS["calibration.json"])
        parts.append(element(0x1941A469, element(0x61A7, kept + element(0x465C, calibration))))
    parts.append(element(0x1254C367, element(0xBF, bytes(4)) + b"".join(tags)))
    return ebml_header() + element(0x18538067, b"".join(parts), UNKNOWN)


def track(
    index: int,
    uid: int,
    name: str,
    fourcc: str,
    width: int,
    height: int,
    more: bytes = b"",
    codec: str = "V_MS/VFW/FOURCC",
) -> bytes:
    """A video track with a BITMAPINFOHEADER; more: further elements of it."""
    bits = BITS.get(fourcc, 24)
    size = 0 if fourcc in ("MJPG", "MPNG") else width * height * bits // 8
    header = struct.pack("<IiiHH4sIiiII", 40, width, height, 1, bits, fourcc.encode(), size, 0, 0, 0, 0)
    video = element(0xE0, number(0xB0, width) + number(0xBA, height))
    texts = element(0x86, codec.encode()) + element(0x536E, name.encode()) + element(0x63A2, header)
    return element(0xAE, number(0xD7, index) + number(0x73C5, uid) + number(0x83, 1) + texts + video + more)


def tag(name: str, value: str, track_uid: int = 0, attachment: int = 0) -> bytes:
    target = number(0x63C5, track_uid) if track_uid else number(0x63C6, attachment) if attachment else b""
    pair = element(0x45A3, name.encode()) + element(0x4487, value.encode())
    return element(0x7373, element(0x63C0, target) + element(0x67C8, pair))


def cluster(
    tick: int, pictures: Sequence[tuple[int, int, bytes]], live: bool = False, flags: int = 0x80
) -> bytes:
    """Pictures (track, ticks after `tick`, bytes) that are written together; live: without sizes, each in a
    group."""
    blocks = []
    for index, after, data in pictures:
        block = bytes([0x80 | index]) + after.to_bytes(2, signed=True) + bytes([flags]) + data
        blocks.append(
            element(0xA0, element(0xA1, block) + number(0x9B, 33333)) if live else element(0xA3, block)
        )
    content = element(0xBF, bytes(4)) + number(0xE7, tick) + b"".join(blocks)
    return element(0x1F43B675, content, UNKNOWN if live else None)


def pack_color(image: NDArray[np.uint8], fourcc: str) -> bytes:
    """An RGB picture in one of the recorder's formats."""
    if fourcc in ("MPNG", "MJPG"):
        suffix = {"MPNG": ".png", "MJPG": ".jpg"}[fourcc]
        return cv2.imencode(suffix, image[..., ::-1])[1].tobytes()
    if fourcc == "BGRA":
        return np.dstack([image[..., ::-1], np.full(image.shape[:2], 255, np.uint8)]).tobytes()
    y, u, v = np.moveaxis(yuv601(image), -1, 0)
    if fourcc == "YUY2":
        pairs = np.stack([y[:, ::2], u[:, ::2], y[:, 1::2], v[:, ::2]], axis=-1)
        return np.rint(pairs).astype(np.uint8).tobytes()
    quarters = np.stack([u[::2, ::2], v[::2, ::2]], axis=-1)  # NV12
    return np.rint(y).astype(np.uint8).tobytes() + np.rint(quarters).astype(np.uint8).tobytes()


def yuv601(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Y (16..235), U and V (16..240) of ITU-R BT.601."""
    kr, kb = 0.299, 0.114
    rgb = image / 255.0
    y = rgb @ [kr, 1 - kr - kb, kb]
    u, v = (rgb[..., 2] - y) / (2 - 2 * kb), (rgb[..., 0] - y) / (2 - 2 * kr)
    return np.stack([16 + 219 * y, 128 + 224 * u, 128 + 224 * v], axis=-1)


def corner(width: int, height: int) -> tuple[int, int]:
    """Where a picture of this size begins in the middle of the depth picture."""
    return (DEPTH_SIZE[0] - width) // 2, (DEPTH_SIZE[1] - height) // 2


def pack_depth(depth: NDArray[np.float32]) -> bytes:
    """Depth in m as the depth track holds it."""
    x, y = corner(depth.shape[1], depth.shape[0])
    whole = np.zeros(DEPTH_SIZE[::-1], ">u2")
    if depth.max() > 65.535:
        raise InputError(f"depth of {depth.max():.3f} m does not fit into 16 bits of mm", "cut it at 65 m")
    whole[y : y + depth.shape[0], x : x + depth.shape[1]] = np.rint(1000.0 * depth)
    return whole.tobytes()


def calibration_of(k: Intrinsics) -> dict[str, Any]:
    """The device's calibration when colour has this camera, and depth the same one with unknown pixels around
    it."""
    if k.width * 3 != k.height * 4 and k.width * 9 != k.height * 16:
        raise InputError(f"colour of {k.width}x{k.height} is neither 4:3 nor 16:9", "crop it")
    rows = k.width * 3 / 4
    x, y = corner(k.width, k.height)
    of_color = [
        (k.cx + 0.5) / k.width,
        (k.cy + 0.5 + (rows - k.height) / 2) / rows,
        k.fx / k.width,
        k.fy / rows,
    ]
    of_depth = [(k.cx + 0.5 + x + 192) / 1024, (k.cy + 0.5 + y + 180) / 1024, k.fx / 1024, k.fy / 1024]
    cameras = [camera("D0", (1024, 1024), of_depth), camera("PV0", (4096, 3072), of_color)]
    return {"CalibrationInformation": {"Cameras": cameras}}


def camera(place: str, sensor: tuple[int, int], pinhole: Sequence[float]) -> dict[str, Any]:
    """A camera without distortion in the device's own place; pinhole: cx cy fx fy on the unit square."""
    purpose = {"D0": "Depth", "PV0": "PhotoVideo"}[place]
    return {
        "Intrinsics": {
            "ModelParameterCount": 14,
            "ModelParameters": [*pinhole, *10 * [0.0]],
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
        },
        "Location": f"CALIBRATION_CameraLocation{place}",
        "Purpose": f"CALIBRATION_CameraPurpose{purpose}",
        "MetricRadius": 1.74,
        "Rt": {"Rotation": np.eye(3).ravel().tolist(), "Translation": [0.0, 0.0, 0.0]},
        "SensorWidth": sensor[0],
        "SensorHeight": sensor[1],
    }
