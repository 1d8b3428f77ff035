"""The user's word: parts that are pointed at, intervals, joint types, up; what can't be meant; runs that
repeat it."""

from __future__ import annotations

import tomllib
import types
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from benchmarks.scenes.tracks import minimum_jerk
from recon.cameras.gravity import find_gravity
from recon.config import ReconConfig
from recon.interaction.parts.find_parts import FoundParts
from recon.interaction.parts.said_parts import outside
from recon.pipeline import _provenance, _run
from recon.readers import open_recording
from recon.recording import Intrinsics, Recording
from recon.recording.said import Said, Word
from recon.tracking.tracks import Tracks
from recon.windows.windows import Window
from tests.makers.recon import tiny
from tests.makers.recon.said import parts_with
from twin import geometry as geo
from twin.cli import main as cli
from twin.errors import ConfigError
from twin.geometry import Array
from twin.runs.settings import from_dict, to_toml
from twin.scene import Joint, Prismatic, Revolute, Trajectory

FRAMES = 60
CAMERA = Intrinsics(96, 72, 80.0, 80.0, 47.5, 35.5)
DOOR = Revolute(geo.unit(np.array([0.05, 1.0, 0.05])), 0.0, 0.8, pivot=np.array([0.35, 0.0, 1.5]))
BEHIND = Prismatic(geo.unit(np.array([1.0, 0.0, 0.2])), 0.0, 0.6)


def moving(joint: Joint, first: int, last: int, size: Array, centre: Array, count: int, seed: int) -> Array:
    """Points (FRAMES, count, 3) of a body whose joint goes through its range between two frames."""
    rng = np.random.default_rng(seed)
    rest = centre + size * rng.uniform(-1.0, 1.0, (count, 3))
    points = geo.transform(joint.poses(joint.upper * minimum_jerk(FRAMES, first, last)), rest)
    return np.asarray(points + rng.normal(0.0, 0.001, points.shape))


def seen(*bodies: Array) -> tuple[Recording, Tracks, Trajectory]:
    """A still camera that sees these bodies at depths that the points have, each everywhere in one colour."""
    points = np.concatenate(bodies, axis=1)
    depth = np.full((FRAMES, CAMERA.height, CAMERA.width), 3.0, np.float32)
    depth[:, :4] = 0.0
    for frame in range(FRAMES):
        x, y = np.rint(CAMERA.project(points[frame])).astype(int).T
        inside = (x >= 0) & (x < CAMERA.width) & (y >= 4) & (y < CAMERA.height)
        depth[frame, y[inside], x[inside]] = points[frame, inside, 2]
    color = np.full((*depth.shape, 3), 128, np.uint8)
    recording = Recording.from_arrays(color, depth, CAMERA, fps=15)
    shape = points.shape[:2]
    pixels = CAMERA.project(points)
    tracks = Tracks(points, pixels, np.ones(shape, bool))
    return (
        recording,
        tracks,
        Trajectory(np.arange(FRAMES), recording.times, np.tile(np.eye(4), (FRAMES, 1, 1))),
    )


def door(first: int = 32, last: int = 50) -> Array:
    """A small door, 24 tracks."""
    return moving(DOOR, first, last, np.array([0.2, 0.25, 0.01]), np.array([0.1, 0.0, 1.5]), 24, 1)


def curtain() -> Array:
    """What slides in the background early on, farther than the door and with thrice as many tracks."""
    return moving(BEHIND, 8, 24, np.array([0.3, 0.5, 0.02]), np.array([-0.7, 0.0, 2.4]), 72, 2)


def pixel(body: Array, frame: int) -> tuple[int, int, int]:
    """A pixel that shows a body's track nearest to its middle."""
    middle = int(np.argmin(np.linalg.norm(body[frame] - body[frame].mean(axis=0), axis=1)))
    x, y = np.rint(CAMERA.project(body[frame, middle])).astype(int)
    return int(x), int(y), frame


def joint_error(found: FoundParts, truth: Joint) -> float:
    """Degrees between the axis of the first part and the true one; 90 for another kind of joint."""
    joint = found.parts[0].part.joint
    return float(np.degrees(geo.line_angle(joint.axis, truth.axis))) if joint.kind == truth.kind else 90.0


def at(*points: tuple[int, int, int]) -> Said:
    return Said(parts=tuple(str(Word(point)) for point in points))


find = partial(parts_with, most=1)  # without a word


def test_a_point_tells_which_of_two_movers_is_the_part() -> None:
    body, other = door(), curtain()
    scene = seen(body, other)
    first = find(*scene).parts[0]
    assert not first.members[:24].any(), "without a word what is behind wins"
    for frame in (10, 41, 56):  # before, while and after it moves
        found = find(*scene, said=at(pixel(body, frame)))
        assert joint_error(found, DOOR) < 1.0
        assert found.parts[0].members[:24].all()
        assert not found.parts[0].members[24:].any()
    assert joint_error(find(*scene, said=at(pixel(other, 16))), BEHIND) < 1.0


def test_what_is_found_without_a_word_stays_unless_it_moves_meanwhile() -> None:
    body, other = door(), curtain()
    scene = seen(body, other)
    both = find(*scene, said=at(pixel(body, 41))).parts
    assert [(p.part.id, p.part.joint.kind) for p in both] == [(2, "revolute"), (3, "prismatic")]
    assert both[1].members[24:].all()
    (alone,) = find(*scene, said=at(pixel(other, 16))).parts  # the word's part is the one found
    assert alone.part.joint.kind == "prismatic"
    late = door(10, 28)  # one hand moves one part at a time, and the user says which
    (alone,) = find(*seen(late, other), said=at(pixel(late, 20))).parts
    assert alone.members[:24].all()
    assert not alone.members[24:].any()


def test_an_interval_leaves_only_what_moves_in_it() -> None:
    scene = seen(door(), curtain())
    for interval, truth in (((30, 52), DOOR), ((6, 26), BEHIND)):
        found = find(*scene, said=Said(parts=(str(Word(interval=interval)),)))
        assert joint_error(found, truth) < 1.0
        (span,) = found.parts[0].part.motion.intervals
        assert interval[0] <= span[0] < span[1] <= interval[1]
        state = found.parts[0].part.motion.state
        assert np.ptp(state[: interval[0] - 5]) == np.ptp(state[interval[1] + 6 :]) == 0.0, "it rests outside"


def test_a_hand_that_goes_along_is_no_part_of_what_is_pointed_at() -> None:
    """It holds the door's edge and turns against it, with more tracks than the door has."""
    body = door(20, 40)
    state = DOOR.upper * minimum_jerk(FRAMES, 20, 40)
    rng = np.random.default_rng(3)
    grip = body[0, np.argmin(body[0, :, 0])]
    held = geo.transform(DOOR.poses(state), grip[None])[:, 0]
    local = rng.uniform(-0.06, 0.06, (40, 3))
    turn = geo.exp_so3(-0.8 * state[:, None] * DOOR.axis)
    hand = held[:, None] + np.einsum(
        "tij,kj->tki", np.einsum("tij,tjk->tik", DOOR.poses(state)[:, :3, :3], turn), local
    )
    hand = hand + rng.normal(0.0, 0.001, hand.shape)
    scene = seen(body, hand)
    found = find(*scene, said=at(pixel(body, 30)))
    assert joint_error(found, DOOR) < 1.0
    assert found.parts[0].members[:24].mean() > 0.9
    assert found.parts[0].members[24:].mean() < 0.1


def test_parts_come_in_the_order_in_which_they_are_said() -> None:
    body, other = door(), curtain()
    points = (pixel(body, 41), pixel(other, 16))
    words = Word(points[0], (30, 52), "hinge"), Word(points[1], (6, 26), "slide")
    said = Said(parts=tuple(map(str, words)))
    found = find(*seen(body, other), said=said)
    assert [(p.part.id, p.part.joint.kind) for p in found.parts] == [(2, "revolute"), (3, "prismatic")]
    assert {p.type_source for p in found.parts} == {"said by the user"}


def test_an_interval_of_one_part_says_nothing_of_another() -> None:
    """The curtain, said without one, moves outside of the door's interval, where else a hand does: it is red,
    and what is red comes before what stands there."""
    body, other = door(), curtain()
    recording, tracks, cameras = seen(body, other)
    depth = np.stack([recording.depth(f) for f in range(FRAMES)])
    color = np.full((*depth.shape, 3), 128, np.uint8)
    for frame in range(FRAMES):
        x, y = np.rint(CAMERA.project(other[frame])).astype(int).T
        for dy, dx in np.ndindex(5, 5):
            at = frame, np.clip(y + dy - 2, 4, CAMERA.height - 1), np.clip(x + dx - 2, 0, CAMERA.width - 1)
            color[at], depth[at] = (200, 30, 30), other[frame, :, 2]
    painted = Recording.from_arrays(color, depth, CAMERA, fps=15)
    said = Said(parts=("--interval 30:52", str(Word(pixel(other, 16)))))
    found = find(painted, tracks, cameras, said=said)
    assert [p.part.joint.kind for p in found.parts] == ["revolute", "prismatic"]
    assert found.parts[1].members[24:].all()


def test_a_point_where_nothing_moves_gives_a_warning_and_no_part() -> None:
    """The curtain is found without a word, and stays."""
    scene = seen(door(), curtain())
    with pytest.warns(UserWarning, match="no part was found for --at 90,70@40: 0 of 0 tracks within 30 cm"):
        (part,) = find(*scene, said=at((90, 70, 40))).parts
    assert part.members[24:].all()
    lost = replace(
        scene[2],
        frames=np.arange(FRAMES - 5),
        times=scene[2].times[:-5],
        T_world_cam=scene[2].T_world_cam[:-5],
    )
    with pytest.warns(UserWarning, match="the camera of frame 58 is not known"):
        (part,) = find(*scene[:2], lost, said=at((47, 35, 58))).parts
    assert part.members[24:].all()


def test_a_type_that_is_said_overrules_motion() -> None:
    """A door that opens a crack looks like a slide; one that opens wide is no slide, and yet is taken as
    said."""
    crack = replace(DOOR, upper=float(np.radians(2.5)))
    body = moving(crack, 20, 40, np.array([0.25, 0.3, 0.02]), np.array([-0.3, 0.0, 1.5]), 60, 1)
    (without,) = find(*seen(body)).parts
    assert (without.part.joint.kind, without.type_source[:6]) == ("prismatic", "motion")
    for body_, word, kind in ((body, "hinge", "revolute"), (door(), "slide", "prismatic")):
        (part,) = find(*seen(body_), said=from_dict(Said, {"type": word})).parts
        assert (part.part.joint.kind, part.type_source) == (kind, "said by the user")


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
        (at((1, 2, 3)), {"said"}),
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
