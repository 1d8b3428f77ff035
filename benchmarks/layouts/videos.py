"""Write a recording's colour as a video."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import av

import recon

QUALITY = "10"  # of x264 and x265; a difference of one or two grey values
MICROSECONDS = Fraction(1, 1_000_000)


class FrameClock(NamedTuple):
    """Frames are shown at start, start + 1, ... ticks, whatever their times."""

    tick: Fraction
    start: int = 0


def write_video(
    recording: recon.Recording,
    out: Path,
    clock: FrameClock | None = None,
    codec: str = "",
    pixels: str = "yuv420p",
    b_frames: int = 2,
    between_keys: int = 12,
    rotation: int = 0,
    frames: int | None = None,
    encoder: Mapping[str, str] | None = None,
    **container: str,
) -> Path:
    """Write colour as a video.

    Args:
        clock: None shows each frame at its time after the first, to a microsecond or as the container rounds
            it.
        codec: FFmpeg's name of an encoder; by default H.264 where it was built in, else MPEG-4.
        b_frames, between_keys: at most so many B-frames in a row, so many frames from a key frame to the
            next.
        rotation: degrees by which players turn the picture; it is stored as it is.
        frames: how many are written; more than there are repeat the last one.
        encoder: more options of FFmpeg's encoder.
        container: options of FFmpeg's muxer, as movflags="frag_keyframe+empty_moov".
    """
    codec = codec or ("libx264" if "libx264" in av.codecs_available else "mpeg4")
    tick = MICROSECONDS if clock is None else clock.tick
    with av.open(str(out), "w", options=container) as file:
        options = {"crf": QUALITY} if "x26" in codec else {}
        stream: Any = file.add_stream(codec, rate=60, options={**options, **(encoder or {})})
        stream.width, stream.height, stream.pix_fmt = (*_size(recording), pixels)
        stream.codec_context.time_base = tick
        stream.codec_context.gop_size = between_keys
        stream.codec_context.max_b_frames = b_frames
        stream.codec_context.bit_rate = 20_000_000
        if rotation:
            stream.set_display_rotation(rotation)
        for i in range(len(recording) if frames is None else frames):
            picture = av.VideoFrame.from_ndarray(recording.color(min(i, len(recording) - 1)), format="rgb24")
            late = max(i - len(recording) + 1, 0) / 60
            after = recording.times[min(i, len(recording) - 1)] - recording.times[0] + late
            picture.pts = round(after / tick) if clock is None else clock.start + i
            picture.time_base = tick
            file.mux(stream.encode(picture))
        file.mux(stream.encode())
    return out


def _size(recording: recon.Recording) -> tuple[int, int]:
    return recording.intrinsics.width, recording.intrinsics.height
