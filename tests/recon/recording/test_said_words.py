"""The user's word in settings, keys, runs and on the command line; up; what can't be meant."""

from __future__ import annotations

import tomllib
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from recon.cameras.gravity import find_gravity
from recon.config import ReconConfig
from recon.interaction.parts.said_parts import outside
from recon.pipeline import _provenance, _run
from recon.readers import open_recording
from recon.recording import Intrinsics, Recording
from recon.recording.said import Said, Word
from recon.windows.windows import Window
from tests.makers.recon import tiny
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import ConfigError
from twin.geometry import Array
from twin.runs.settings import from_dict, to_toml
from twin.scene import Trajectory

CAMERA = Intrinsics(96, 72, 80.0, 80.0, 47.5, 35.5)


def corner(pitch_deg: float) -> tuple[Recording, Trajectory, Array]:
    """A still camera, pitched down, before a wall and a floor; and up in its axes."""
    p = np.radians(pitch_deg)
    R = np.array(
        [[1.0, 0, 0], [0, -np.sin(p), np.cos(p)], [0, -np.cos(p), -np.sin(p)]]
    )  # world from camera, z up
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.backproject(np.stack([u, v], -1).astype(float), np.ones(u.shape)) @ R.T
    floor, wall = (
        np.where(rays[..., 2] < -0.01, -1.3 / rays[..., 2], 9.0),
        np.where(rays[..., 1] > 0.01, 2.0 / rays[..., 1], 9.0),
    )
    depth = np.tile(np.minimum(floor, wall).astype(np.float32), (10, 1, 1))
    recording = Recording.from_arrays(np.zeros((*depth.shape, 3), np.uint8), depth, CAMERA, fps=15)
    return (
        recording,
        Trajectory(np.arange(10), recording.times, np.tile(np.eye(4), (10, 1, 1))),
        R.T @ [0.0, 0.0, 1.0],
    )


def test_up_is_taken_as_it_is_said() -> None:
    recording, cameras, up = corner(50.0)

    def error(said: Any, towards: Array) -> tuple[float, str]:
        gravity = find_gravity(recording, cameras, said)
        return float(
            np.degrees(geo.angle_between(gravity.R_world_start @ towards, [0, 0, 1]))
        ), gravity.source

    without = find_gravity(recording, cameras)
    assert geo.angle_between(without.R_world_start @ up, [0, 0, 1]) > 1.5, (
        "so steep that the wall is taken for the floor"
    )
    tilted = geo.exp_so3(np.radians(5.0) * np.array([0.6, 0.0, 0.8])) @ up
    refined = (pytest.approx(0.0, abs=1.0), "said, refined by planes")
    for right in ("-z", tuple(up.tolist()), tuple(tilted.tolist())):
        assert error(right, up) == refined
    wall = geo.unit(np.cross([1.0, 0.0, 0.0], up))
    assert error(tuple(wall.tolist()), wall) == refined, "wrong by 90 degrees is followed"
    assert error("+x", np.array([1.0, 0.0, 0.0])) == refined
    oblique = geo.unit(up + [1.0, 0.0, 0.0])
    assert error(tuple(oblique.tolist()), oblique) == (pytest.approx(0.0, abs=1e-5), "said"), (
        "no plane is near"
    )
    device = replace(recording, gravity_camera0=[1.0, 0.0, 0.0])
    assert find_gravity(device, cameras, "-z").source == "said, refined by planes"


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            {"parts": ("--interval 9:9",)},
            "parts = .* must have intervals whose first frame is before the last",
        ),
        ({"parts": ("--at 1,2@3", "--type hinge")}, "must be texts such as '--at 320,240@45'"),
        ({"parts": ("--at 1,-2@3",)}, "must be texts such as"),
        ({"parts": ("--at 1,2@3 --type ball",)}, "must be texts such as"),
        ({"parts": ("--at 1,2@3\n",)}, "must be texts such as"),
        ({"type": "ball"}, "must be one of 'hinge', 'slide'"),
        ({"up": (0.0, 0.0, 0.0)}, "up = .* must be a direction, not zero"),
        ({"up": (0.0, float("nan"), 0.0)}, "must be finite"),
    ],
)
def test_what_can_not_be_meant_is_refused(said: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Said(**said)


def test_spans_outside_of_intervals() -> None:
    assert outside([(30, 50)], 90) == [(0, 27), (53, 89)]
    assert outside([(60, 88), (10, 20), (15, 30)], 90) == [(0, 7), (33, 57)]
    assert outside([], 90) == [(0, 89)]


SAID = Said(("--at 31,40@5 --interval 3:28 --type hinge",), None, (0.0, -1.0, 0.25))


def test_the_word_is_kept_in_the_settings_and_told() -> None:
    config = ReconConfig(said=SAID)
    assert from_dict(ReconConfig, tomllib.loads(to_toml(config))) == config
    told = ["--at 31,40@5 --interval 3:28 --type hinge", "--up 0,-1,0.25"]
    assert _provenance(config, (), ())["said"] == told
    assert Said().after(told) == SAID
    other = Said(("--interval 1:9",), "slide", "-y")
    assert other.after(told) == Said((*SAID.parts, *other.parts), "slide", "-y"), (
        "it overrules what was said before"
    )
    assert SAID.after(other.texts) == Said((*other.parts, *SAID.parts), "slide", SAID.up)
    assert SAID.after(SAID.texts) == SAID
    assert "said" not in _provenance(ReconConfig(), (), ())


def test_the_word_changes_the_keys_of_the_stages_that_it_is_about() -> None:
    def settings(said: Said) -> dict[str, object]:
        seen: dict[str, object] = {}

        class Recorder:
            def loop(self, _: str) -> None: ...

            def stage(self, name: str, _: int, settings: object, *_more: object, **_items: object) -> Any:
                seen[name] = settings
                if name == "verdict":
                    raise KeyboardInterrupt
                world: Any = types.SimpleNamespace(
                    static=None, up=(0.0, 0.0, 1.0), doubt=None, parts=(), shares=()
                )
                value = {"inspect": (), "windows": (Window(0, 9),)}.get(name, world)
                return types.SimpleNamespace(value=value, warnings=())

        recording = Recording.from_arrays(
            np.zeros((10, 4, 6, 3), np.uint8),
            np.ones((10, 4, 6)),
            Intrinsics(6, 4, 5.0, 5.0, 2.5, 1.5),
            fps=10,
        )
        with pytest.raises(KeyboardInterrupt):
            _run(Recorder(), recording, ReconConfig(said=said), (), None)  # type: ignore[arg-type]
        return seen

    without = settings(Said())
    for said, changed in (
        (Said(up="-y"), {"gravity"}),
        (Said(parts=(str(Word((1, 2, 3))),)), {"said"}),
        (Said(parts=("--interval 1:20",)), {"said"}),
        (Said(type="slide"), {"motion"}),
        (SAID, {"gravity", "said"}),
    ):
        now = settings(said)
        assert {name for name in now if now[name] != without.get(name)} == changed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tiny.write_recording(tmp_path_factory.mktemp("said") / "r", ("door",), scale=1, still=True)
    path = made / "depth" / "000003.png"
    depth = tiny.read_image(path)
    depth[:5, :7] = 0
    cv2.imwrite(str(path), depth)
    return made


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--at 3,4", "'3,4' is no pixel of a frame: write X,Y@FRAME"),
        ("--at -3,4@5", "'-3,4@5' is no pixel"),
        ("--at 96,4@5", "--at 96,4@5: the picture has 96x72 pixels"),
        ("--at 40,30@30", "--at 40,30@30: the recording has frames 0..29"),
        (
            "--at 0,0@3",
            "--at 0,0@3: there is no depth at this pixel; say another one; the nearest with depth is 0,5",
        ),
        ("--interval 9:3", "'9:3' is no interval"),
        ("--interval 2s:1.5s", "'2s:1.5s' is no interval"),
        ("--interval 2:3.5s", "'2:3.5s' is no interval"),
        ("--at 3,4@99.5s", "99.5s: the recording ends after "),
        ("--interval 3:30", "--interval 3:30: the recording has frames 0..29"),
        (
            "--at 40,30@3 --at 41,30@3 --interval 3:9",
            "1 --interval for 2 --at: they pair in order; give one for each --at, or none",
        ),
        ("--at 40,30@3 --type hinge --type slide", "2 --type for 1 parts that are said"),
        ("--type ball", "invalid choice: 'ball'"),
        ("--up q", "'q' is no direction"),
        ("--up 0,0,0", "'0,0,0' is no direction"),
        ("--up -y --set said.parts=3", "said.parts = 3 must be a list"),
    ],
)
def test_the_command_line_tells_what_is_wrong_in_one_line(
    options: str, words: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["reconstruct", str(folder), "-o", str(tmp_path / "run"), *options.split()]) == 1
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
    assert not (tmp_path / "run" / "stages").exists()


def test_the_command_line_says_it_as_python_does(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from recon import pipeline

    heard: list[Said] = []

    class Done(Exception): ...

    def stop(_: object, config: ReconConfig, **_more: object) -> None:
        heard.append(config.said)
        raise Done

    monkeypatch.setattr(pipeline, "reconstruct", stop)
    (tmp_path / "c.toml").write_text(to_toml(ReconConfig(said=replace(SAID, up="+z"))))
    times = open_recording(folder).times
    times = np.asarray(times) - times[0]
    start = ["reconstruct", str(folder), "-o", str(tmp_path / "run")]
    for options in (
        "--at 31,40@5 --interval 3:28 --type hinge --up 0,-1,0.25",
        f"--at 31,40@{times[5] + 0.01}s --interval {times[3]}s:{times[28]:.3f}s --type hinge --up 0,-1,0.25",
        f"--config {tmp_path / 'c.toml'} --up 0,-1,0.25",
        f"--config {tmp_path / 'c.toml'}",
        "--up -y",
    ):
        with pytest.raises(Done):
            cli.run([*start, *options.split()])
    assert heard == [SAID, SAID, SAID, replace(SAID, up="+z"), Said(up="-y")]
