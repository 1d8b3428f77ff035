"""HOI4D's layout: what is written is read again, in its units, axes and clocks; what is wrong is told in one
line."""

from __future__ import annotations

import shutil
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.readers.hoi4d import Hoi4dReader
from tests.makers.recon.clips import FRAMES, assert_poses, assert_same, read, refused


@pytest.mark.parametrize("nested", [False, True])
def test_hoi4d_round_trip(recording: recon.Recording, T: Any, tmp_path: Path, nested: bool) -> None:
    clip = write.write_hoi4d(recording, tmp_path, nested=nested)
    write.write_hoi4d_annotations(tmp_path / "HOI4D_annotations" / write.CLIP, T, [])
    found = read(Hoi4dReader(), clip)
    assert_same(found, recording)
    assert_poses(found, T)
    np.testing.assert_allclose(found.times, np.arange(FRAMES) / 15)
    assert found.name == "ZY20210800001_H1_C4_N11_S1_s1_T1"
    assert found.warnings == ()


def test_hoi4d_log_is_camera_to_world_where_open3d_hands_back_the_inverse(T: Any, tmp_path: Path) -> None:
    import open3d as o3d

    from recon.readers.hoi4d import read_redwood_log

    folder = write.write_hoi4d_annotations(tmp_path, T, [])
    log = folder / "3Dseg" / "output.log"
    np.testing.assert_allclose(read_redwood_log(log), T, atol=1e-10)
    by_open3d = o3d.io.read_pinhole_camera_trajectory(str(log)).parameters
    np.testing.assert_allclose(np.linalg.inv(by_open3d[3].extrinsic), T[3], atol=1e-6)


def test_hoi4d_numbers_are_frames_also_where_some_are_missing(
    recording: recon.Recording, tmp_path: Path
) -> None:
    clip = write.write_hoi4d(recording, tmp_path)
    for name in ("align_rgb/00003.jpg", "align_depth/00005.png"):
        (clip / name).unlink()
    found = read(Hoi4dReader(), clip)
    np.testing.assert_allclose(found.times * 15, [0, 1, 2, 4, 6, 7, 8, 9, 10, 11])
    np.testing.assert_allclose(found.depth(4), recording.depth(6), atol=5e-4)
    assert found.warnings[0].endswith("1 of 11 colour images have no depth image in time")


def test_hoi4d_colour_from_the_video(
    recording: recon.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Video:
        """The interface that the reader needs."""

        width, height = recording.intrinsics.width, recording.intrinsics.height
        times = 0.2 + np.arange(FRAMES) / 15

        def __init__(self, path: Path) -> None:
            assert path.name == "image.mp4"

        def read(self, index: int) -> Any:
            return recording.color(index)

    module = types.ModuleType("recon.readers.video")
    module.Video = Video  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "recon.readers.video", module)
    clip = write.write_hoi4d(recording, tmp_path)
    shutil.rmtree(clip / "align_rgb")
    (clip / "align_rgb").mkdir()
    (clip / "align_rgb" / "image.mp4").write_bytes(b"video")
    assert_same(read(Hoi4dReader(), clip), recording, color=0.0)


def test_hoi4d_refusals(recording: recon.Recording, T: Any, tmp_path: Path) -> None:
    def clip(name: str) -> Path:
        return write.write_hoi4d(recording, tmp_path / name)

    packed = clip("packed")
    shutil.rmtree(packed / "align_depth")
    (packed / "align_depth").mkdir()
    (packed / "align_depth" / "depth_video.avi").write_bytes(b"RIFF")
    assert "utils/decode.py" in refused(Hoi4dReader(), packed, "depth packed as video")
    alone = clip("alone")
    shutil.rmtree(tmp_path / "alone" / "camera_params")
    refused(Hoi4dReader(), alone, "no camera_params/ZY20210800001/intrin.npy")
    K = tmp_path / "other" / "camera_params" / "ZY20210800001" / "intrin.npy"
    other = clip("other")
    np.save(K, np.array([[1060.0, 0, 971.0], [0, 1061.0, 523.0], [0, 0, 1]]))
    refused(Hoi4dReader(), other, "principal point .* outside the 96x72 image")
    np.save(K, np.array([{}], dtype=object), allow_pickle=True)
    refused(Hoi4dReader(), other, "pickled objects")
    np.save(K, np.eye(4))
    refused(Hoi4dReader(), other, r"shape \(4, 4\), not \(3, 3\)")
    turned = clip("turned")
    (turned / "align_depth" / "00000.png").write_bytes(write.png(np.full((50, 96), 900, np.uint16)))
    refused(Hoi4dReader(), turned, "is 96x50, colour 96x72")
    log = write.write_hoi4d_annotations(clip("log"), T, []) / "3Dseg" / "output.log"
    text = log.read_text()
    log.write_text(text[: len(text) // 2])
    refused(Hoi4dReader(), log.parents[1], "begins no pose")
