"""Depth that a ROS driver squeezed into JPEG is told by name: it is neither colour nor read as depth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.recording import Recording
from tests.makers.recon import bags
from tests.makers.recon.bags import check_same, opened, problem
from tests.recon.readers.test_ros_images import png_of, write_compressed


@pytest.fixture(scope="module")
def original() -> Recording:
    return bags.frames()


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


def eight_bits(original: Recording, k: int) -> bytes:
    """What is left of depth: as cv_bridge converts it."""
    return jpeg(np.clip(np.rint(original.depth(k) * 1000), 0, 255).astype(np.uint8))


def test_depth_in_jpeg_is_told_by_name(tmp_path: Path, original: Recording) -> None:
    for n, form in enumerate(("16UC1; jpeg compressed ", "32FC1; jpeg compressed bgr8")):
        path = write_compressed(
            original,
            tmp_path / str(n),
            lambda k: ("rgb8; jpeg compressed bgr8", jpeg(original.color(k)[..., ::-1])),
            lambda k, form=form: (form, eight_bits(original, k)),  # type: ignore[misc]
        )
        for options in ({}, {"depth_topic": "/camera/aligned_depth_to_color/image_raw/compressed"}):
            said = problem(path, calibrated=bags.CALIBRATED, **options)
            assert "is depth in JPEG" in said
            assert form.lower().strip() in said
            assert "aligned_depth_to_color" in said
            remedy = said[said.index("record depth") :]
            assert "compressedDepth (PNG)" in remedy
            assert "JPEG" not in remedy


def test_depth_in_jpeg_is_never_taken_for_colour(tmp_path: Path, original: Recording) -> None:
    """Where another topic holds the depth it is passed over."""
    png = png_of(original)
    path = write_compressed(
        original,
        tmp_path / "a",
        lambda k: ("16UC1; jpeg compressed", eight_bits(original, k)),
        lambda k: ("16UC1; png compressed mono16", png(k)),
    )
    said = problem(path, calibrated=bags.CALIBRATED)
    assert "has no colour topic" in said
    assert "record colour raw, as JPEG or as PNG" in said


def test_a_bag_without_depth_is_not_told_to_record_jpeg(tmp_path: Path, original: Recording) -> None:
    picture = lambda k: ("jpeg", jpeg(original.color(k)[..., ::-1]))  # noqa: E731
    said = problem(write_compressed(original, tmp_path / "a", picture, picture), calibrated=bags.CALIBRATED)
    assert "has no depth topic" in said
    assert "compressedDepth (PNG)" in said
    assert "JPEG" not in said


def test_grey_pictures_of_16_bits_in_jpeg_stay_colour(tmp_path: Path, original: Recording) -> None:
    png = png_of(original)
    grey = np.asarray(original.color(0)[..., 0])
    path = write_compressed(
        original,
        tmp_path / "a",
        lambda _: ("mono16; jpeg compressed", jpeg(grey)),
        lambda k: ("16UC1; png compressed", png(k)),
    )
    found = opened(path, calibrated=bags.CALIBRATED)
    np.testing.assert_allclose(found.depth(3), original.depth(3), atol=1e-6)
    check_same(found, original, color=255)
