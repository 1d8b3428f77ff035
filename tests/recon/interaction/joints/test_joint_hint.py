"""Hints about joint types: they tip what motion leaves open, clear motion overrules them, and bad ones are
named."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.tracks import PartName, minimum_jerk, track_scene
from recon.interaction.joints.fit_tracks import fit_motion
from recon.interaction.joints.type_selection import (
    HINT_WEIGHT,
    Kind,
    TypeEvidence,
    TypeHint,
    decide,
    hint_about,
)
from recon.interaction.parts.find_parts import find_parts
from recon.models import joint_hint
from recon.models.joint_hint import read_hints
from recon.readers import open_recording
from recon.tracking.tracks import Tracks
from tests.makers.recon import tiny
from tests.makers.twin.vlm_server import KEY, Reply, completion, serving
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import ConfigError, InputError, ServiceError
from twin.scene import Revolute, Trajectory

TINY = float(np.radians(2.5))  # below the 3 degrees that motion alone needs
SAID = {"object_name": "oven door", "joint_type": "revolute", "first_frame": 5, "last_frame": 30}


def hint(kind: Kind, first: int = 5, last: int = 35) -> TypeHint:
    return TypeHint(kind, first, last, "seer-1")


@pytest.mark.parametrize(
    ("part", "travel", "told", "kind", "source"),
    [
        ("door", 1.2, "prismatic", "revolute", "motion .*overrules the hint prismatic"),
        ("drawer", 0.3, "revolute", "prismatic", "motion .*overrules the hint revolute"),
        ("drawer", 0.02, "revolute", "prismatic", "motion .*overrules the hint revolute"),
        ("door", TINY, "revolute", "revolute", "hint revolute .seer-1; motion leaves it open"),
        ("door", TINY, "prismatic", "prismatic", "motion .*so does the hint say"),
        ("door", TINY, None, "prismatic", "motion .*needs 3 deg.$"),
        ("door", 1.2, "revolute", "revolute", "motion .*so does the hint say"),
    ],
)
def test_clear_motion_overrules_a_hint_and_open_motion_follows_it(
    part: PartName, travel: float, told: Kind | None, kind: Kind, source: str
) -> None:
    scene = track_scene(part, "none", travel=travel, noise=0.001, tracks=80)
    found = fit_motion(scene.points, scene.visible, hints=(hint(told),) if told else ())
    assert found.joint.kind == kind
    assert re.match(source, found.type_source), found.type_source


@pytest.mark.parametrize(
    ("delta_bic", "turned_deg", "radius", "told", "kind"),
    [
        (20.0 + HINT_WEIGHT + 1, 10.0, 0.5, "prismatic", "revolute"),
        (20.0 + HINT_WEIGHT - 1, 10.0, 0.5, "prismatic", "prismatic"),
        (20.0 - HINT_WEIGHT + 1, 10.0, 0.5, "revolute", "revolute"),
        (20.0 - HINT_WEIGHT - 1, 10.0, 0.5, "revolute", "prismatic"),
        (500.0, 1.0, 0.5, "revolute", "revolute"),
        (500.0, 1.0, 3.1, "revolute", "prismatic"),
        (float("inf"), 10.0, 0.5, "prismatic", "revolute"),
        (0.0, 0.0, float("inf"), "revolute", "prismatic"),
    ],
)
def test_a_hint_weighs_what_it_states(
    delta_bic: float, turned_deg: float, radius: float, told: Kind, kind: Kind
) -> None:
    evidence = TypeEvidence(delta_bic, float(np.radians(turned_deg)), radius)
    assert decide(evidence, hint(told))[0] == kind
    alone, why = decide(evidence)
    without_weight = TypeHint(told, 1, 2, "seer-1", weight=0.0)
    if turned_deg > 3:
        assert decide(evidence, without_weight)[0] == alone
    assert why.startswith("motion")


def test_a_hint_is_about_what_moves_in_its_frames() -> None:
    state = minimum_jerk(60, 10, 30)
    early, late = hint("revolute", 8, 25), hint("prismatic", 40, 55)
    assert hint_about((late, early), state) is early
    assert hint_about((late,), state) is None
    assert hint_about((), state) is None
    assert hint_about((early,), np.zeros(60)) is None
    assert hint_about((hint("prismatic", 0, 15), early), state) is early
    with pytest.raises(ConfigError, match="first < last"):
        hint("revolute", 5, 5)


def test_the_parts_of_a_recording_take_hints(tmp_path: Path) -> None:
    """A door that opens a crack only, once without and once with a hint; the hint of another time changes
    nothing."""
    frames = 60
    folder = tiny.write_recording(tmp_path / "still", ("door",), frames=frames, still=True)
    recording = open_recording(folder)
    rng = np.random.default_rng(3)
    joint = Revolute(geo.unit(np.array([0.1, 1.0, 0.05])), 0.0, 1.0, pivot=np.array([0.2, 0.0, 1.5]))
    door = joint.pivot + [0.5, 0.0, 0.0] + np.array([0.25, 0.4, 0.02]) * rng.uniform(-1.0, 1.0, (60, 3))
    points = geo.transform(joint.poses(np.radians(2.8) * minimum_jerk(frames, 20, 40)), door)
    points = points + rng.normal(0.0, 0.001, points.shape)
    seen = np.ones(points.shape[:2], bool)
    tracks = Tracks(points, np.zeros((*seen.shape, 2)), seen)
    still = Trajectory(np.arange(frames), recording.times, np.tile(np.eye(4), (frames, 1, 1)))

    def found(*hints: TypeHint) -> tuple[str, str]:
        part = find_parts(recording, tracks, still, hints=hints).parts[0]
        return part.part.joint.kind, part.type_source.split(" ")[0]

    assert found() == ("prismatic", "motion")
    assert found(hint("revolute", 18, 45)) == ("revolute", "hint")
    assert found(hint("revolute", 2, 10)) == ("prismatic", "motion")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ('{"parts": {}}', "parts must be a list of objects"),
        ('{"parts": [3]}', "parts must be a list of objects"),
        (json.dumps({"parts": [SAID | {"joint_type": "ball"}]}), r"parts\[0\].joint_type must be revolute"),
        (json.dumps({"parts": [SAID | {"last_frame": 60}]}), r"must lie in 0..59, is 5 to 60"),
        (json.dumps({"parts": [SAID | {"first_frame": 30}]}), r"must lie in 0..59, is 30 to 30"),
        (json.dumps({"parts": [SAID | {"first_frame": "5"}]}), "first_frame must be a number"),
        (json.dumps({"parts": [{"joint_type": "revolute"}]}), "first_frame is missing"),
    ],
)
def test_hints_that_can_not_be_meant_are_named(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ServiceError, match=message):
        read_hints(text, 60, "seer-1")


def test_hints_may_be_written_by_hand(tmp_path: Path) -> None:
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    )
    path = tmp_path / "hint.json"
    path.write_text(json.dumps({"parts": [SAID, SAID | {"joint_type": "unknown"}]}))
    (found,) = joint_hint(str(path))(recording, None)
    assert (found.kind, found.first, found.last) == ("revolute", 5, 30)
    assert "hint.json" in found.source
    assert "oven door" in found.source
    path.write_text("{}")
    with pytest.raises(InputError, match=r"hint\.json is refused: parts is missing"):
        joint_hint(str(path))(recording, None)
    with pytest.raises(InputError, match="can't be read"):
        joint_hint(str(tmp_path / "none.json"))(recording, None)


@pytest.mark.parametrize("form", ["{}", "```json\n{}\n```"])
def test_a_model_is_asked_about_frames(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("httpx", reason="needs the extra vlm")
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    )
    with serving(Reply(completion(form.replace("{}", json.dumps({"parts": [SAID]}))))) as server:
        monkeypatch.setenv("FUNTWIN_VLM_URL", server.url)
        monkeypatch.setenv("FUNTWIN_VLM_KEY", KEY)
        monkeypatch.setenv("FUNTWIN_VLM_MODEL", "seer-1")
        ask = joint_hint("vlm")
        (found,) = ask(recording, tmp_path / "vlm")
        assert ask(recording, tmp_path / "vlm") == (found,)
    (asked,) = server.asked
    assert (found.kind, found.first, found.last) == ("revolute", 5, 30)
    assert "seer-1" in found.source
    content = asked.body["messages"][1]["content"]
    assert "frames 0, 6, 11, 17, 22, 28, 33, 39" in content[0]["text"]
    assert len(content) == 9


def test_no_key_is_one_line_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("FUNTWIN_VLM_URL", "FUNTWIN_VLM_KEY", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    folder = tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    out = tmp_path / "run"
    assert cli.run(["reconstruct", str(folder), "-o", str(out), "--type-hint", "vlm", "--json"]) == 1
    err = capsys.readouterr().err
    assert "no key for a vision-language model is set" in err
    assert err.count("\n") == 1
    assert list((out / "stages").glob("[0-9]*")) == []
