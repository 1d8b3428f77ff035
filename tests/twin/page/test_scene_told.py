"""What the scene of the page is made of: what its scripts are told, the film, the library, a notebook."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import twin as tw
from tests.makers.browser import browser
from tests.makers.viewer import HOSTILE, pictured
from twin import report
from twin.errors import InputError, SceneError
from twin.page import render, viewer
from twin.scene import Twin
from twin.storage import save


def test_what_the_scripts_are_told_is_the_twin(twin: Twin, tmp_path: Path) -> None:
    told = viewer.scene_document(tmp_path, twin)
    json.dumps(told, allow_nan=False)
    assert told["film"] == {"frames": []}
    assert twin.cameras is not None
    assert told["cameras"]["times"][0] == 0
    assert np.allclose(told["cameras"]["positions"], twin.cameras.T_world_cam[:, :3, 3], atol=1e-5)
    for part, one in zip(twin.parts, told["parts"], strict=True):
        assert np.allclose(np.array(one["times"]) + 7.0, part.motion.times, atol=1e-5)
        assert (one["lower"], one["upper"]) == (part.joint.lower, part.joint.upper)


def test_the_film_has_the_frames_with_labels_and_no_more_than_it_may(twin: Twin) -> None:
    assert twin.cameras is not None
    many = np.arange(1000)
    cameras = replace(
        twin.cameras, frames=many, times=many / 15, T_world_cam=np.tile(np.eye(4), (1000, 1, 1))
    )
    labels = dict.fromkeys((3, 501, 998), twin.labels[0])
    frames = report.film_frames(replace(twin, cameras=cameras, labels=labels))
    assert {3, 501, 998} <= set(frames)
    assert len(frames) <= 240 + 3
    assert frames == sorted(frames)


def test_another_film_takes_the_place_of_the_first(twin: Twin, tmp_path: Path) -> None:
    report.save_film(tmp_path, [0, 4, 8], pictured)
    report.save_film(tmp_path, [4, 5], pictured)
    assert sorted(p.name for p in (tmp_path / "report" / "film").glob("*.jpg")) == [
        "000004.jpg",
        "000005.jpg",
    ]


def test_a_twin_that_can_t_move_has_a_page_without_scene(twin: Twin, tmp_path: Path) -> None:
    part = twin.parts[0]
    stuck = replace(
        part,
        joint=replace(part.joint, lower=0.0, upper=0.0),
        motion=replace(part.motion, state=0 * part.motion.state),
    )
    save(replace(twin, parts=(stuck,)), tmp_path / "twin")
    text = render(tmp_path).read_text(encoding="utf-8")
    assert 'id="glb"' not in text
    assert "door" in text


def test_another_trimesh_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(trimesh, "__file__", str(tmp_path / "__init__.py"))  # no viewer beside it
    viewer.three_js.cache_clear()
    with pytest.raises(SceneError, match="ships no viewer"):
        viewer.three_js()
    viewer.three_js.cache_clear()


def test_only_the_library_is_taken() -> None:
    text = viewer.three_js()
    assert text.startswith("/**\n * @license")
    assert "SPDX-License-Identifier: MIT" in text[:200]
    assert not re.search(r"B64GLTF|tracklight|</script", text)


def test_a_notebook_shows_the_twin_in_a_frame_of_its_own(twin: Twin, tmp_path: Path) -> None:
    shown = tw.show(twin, height=500)
    frame = shown._repr_html_()
    assert frame.startswith('<iframe sandbox="allow-scripts"')
    assert "500px" in frame
    assert HOSTILE not in frame
    assert "MB" in repr(shown)
    with pytest.raises(InputError, match="px high"):
        tw.show(twin, height=0)
    page = tmp_path / "notebook.html"
    page.write_text(f"<!doctype html><title>n</title>{frame}", encoding="utf-8")
    with browser(tmp_path / "profile") as tab:
        tab.open(page.as_uri())
        tab.until("document.querySelector('iframe') && 1")
        time.sleep(2.0)
        assert tab.complaints == []
        assert len(np.unique(tab.picture("iframe").reshape(-1, 3), axis=0)) > 200  # something is drawn
