"""A name that a part was given stays with it in every later run of the recording, whatever number the part
gets there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.scenes.boards import cabinet_twin
from recon.verdict.assemble import given_names
from twin.scene import Recorded, Twin

FINGERPRINT = "a" * 64
RECORDING: Any = SimpleNamespace(fingerprint=FINGERPRINT)


def images(door: int, drawer: int, shift: int = 0) -> dict[int, Any]:
    """Label images in which the two parts have these ids."""
    image = np.ones((40, 60), np.uint8)
    image[2:20, 5 + shift : 30 + shift] = door
    image[22:38, 10:50] = drawer
    return {0: image, 8: image.copy()}


def earlier(fingerprint: str = FINGERPRINT) -> Twin:
    """`wine`, which was the door with id 2, and `drawer` with id 3."""
    twin = cabinet_twin()
    parts = (replace(twin.parts[0], name="wine"), twin.parts[1])
    return replace(twin, parts=parts, labels=images(2, 3), recorded=Recorded("r", 9, fingerprint))


def test_a_part_keeps_its_name_under_another_id() -> None:
    assert given_names(earlier(), RECORDING, images(3, 2)) == {3: "wine", 2: "drawer"}


def test_a_part_whose_pixels_are_nearly_the_same_keeps_its_name() -> None:
    assert given_names(earlier(), RECORDING, images(2, 3, shift=4)) == {2: "wine", 3: "drawer"}
    assert given_names(earlier(), RECORDING, images(2, 3, shift=12)) == {3: "drawer"}


def test_parts_of_another_recording_give_no_names() -> None:
    assert given_names(earlier("b" * 64), RECORDING, images(2, 3)) == {}
    assert given_names(None, RECORDING, images(2, 3)) == {}


def test_what_is_no_part_any_more_gives_no_name() -> None:
    assert given_names(earlier(), RECORDING, images(1, 255)) == {}
