"""Write a recording as an MCAP log without any index, as small recorders do; by the published
specification."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from benchmarks.layouts.ros import ALIGNED, COLOR, COLOR_FRAME, Ros, Style, place_of
from recon.recording import Recording


def write_plain_mcap(recording: Recording, out: Path, chunked: bool = False) -> Path:
    """An MCAP log without any index: messages one after the other, or in one chunk of zstd that holds all
    there is."""
    from backports import zstd

    store = Ros(None, False)
    schemas = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo")
    topics = (COLOR, ALIGNED, f"{place_of(COLOR)}/camera_info", f"{place_of(ALIGNED)}/camera_info")
    body = b"".join(
        _record(3, struct.pack("<H", n + 1) + _text(s) + _text("ros2msg") + _text(""))
        for n, s in enumerate(schemas)
    )
    for n, topic in enumerate(topics):
        about = struct.pack("<HH", n, n // 2 + 1) + _text(topic) + _text("cdr") + struct.pack("<I", 0)
        body += _record(4, about)
    for k, time in enumerate(recording.times):
        stamp = round(time * 1e9)
        frame = recording.frame(k)
        millimetres = np.rint(frame.depth * 1000).astype(np.uint16)
        info = store.info(stamp, COLOR_FRAME, recording.intrinsics, "plumb_bob", (0.0,) * 5)
        color = store.image(stamp, COLOR_FRAME, frame.color, "rgb8", Style())
        depth = store.image(stamp, COLOR_FRAME, millimetres, "16UC1", Style())
        for n, message in enumerate((color, depth, info, info)):
            data = bytes(store.store.serialize_cdr(message, schemas[n // 2]))
            body += _record(5, struct.pack("<HIQQ", n, k, stamp, stamp) + data)
    if chunked:
        packed = zstd.compress(body)
        head = struct.pack("<QQQI", 0, 2**62, len(body), 0) + _text("zstd")
        body = _record(6, head + struct.pack("<Q", len(packed)) + packed)
    end = _record(15, struct.pack("<I", 0)) + _record(2, struct.pack("<QQI", 0, 0, 0))
    out.write_bytes(b"\x89MCAP0\r\n" + _record(1, _text("ros2") + _text("")) + body + end + b"\x89MCAP0\r\n")
    return out


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text.encode())) + text.encode()
