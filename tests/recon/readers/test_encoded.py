"""Pictures that claim to be huge are refused before a decoder allocates what they claim."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.readers import files
from recon.readers.encoded import picture_size
from twin.errors import InputError

IMAGE = np.zeros((48, 64, 3), np.uint8)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_size_is_told_without_decoding(suffix: str) -> None:
    data = cv2.imencode(suffix, IMAGE)[1].tobytes()
    assert picture_size(data) == (64, 48)
    assert picture_size(memoryview(data)) == (64, 48)
    assert picture_size(data[:10]) == (0, 0)
    assert picture_size(b"GIF89a" + data) == (0, 0)


def test_huge_claims_are_refused() -> None:
    png = bytearray(cv2.imencode(".png", IMAGE)[1].tobytes())
    png[16:24] = struct.pack(">II", 60000, 60000)
    jpeg = bytearray(cv2.imencode(".jpg", IMAGE)[1].tobytes())
    at = jpeg.index(b"\xff\xc0")
    jpeg[at + 5 : at + 9] = struct.pack(">HH", 65500, 65500)
    with pytest.raises(InputError, match=r"a\.png claims 60000x60000"):
        files.decode_color("a.png", bytes(png))
    with pytest.raises(InputError, match=r"a\.png claims 60000x60000"):
        files.decode_depth("a.png", bytes(png), 1000.0)
    with pytest.raises(InputError, match=r"a\.jpg claims 65500x65500"):
        files.decode_color("a.jpg", bytes(jpeg))


def test_deep_json_is_told(tmp_path: Path) -> None:
    (tmp_path / "deep.json").write_text("[" * 200_000)
    with pytest.raises(InputError, match=r"deep\.json is not JSON"):
        files.read_json(tmp_path / "deep.json")
