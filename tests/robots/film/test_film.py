"""The film of a replay: beside the robot stands the frame in which the person had the part at the robot's
state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import SETTLE, PlanConfig
from robots.demonstration import Demonstration, matching_samples
from robots.film.closeup import with_insets
from robots.film.side_by_side import captioned, fitted, pace_text, side_by_side, state_text
from robots.film.video import RATE
from robots.floor import Floor
from robots.scene.world import build_world
from robots.simulation.replay import simulate
from tests.robots.planning.test_replay import can_draw
from twin.errors import InputError
from twin.scene import Motion, Part, Twin

FAST = PlanConfig(candidates=150, finalists=2)
FIRST = 7  # recording frame of the first sample: frames aren't samples
SMALL = robots.ReplayConfig(video_size=(161, 121), video_frames=24)


def motion_of(state: object) -> Motion:
    state = np.asarray(state, dtype=float)
    frames = FIRST + 2 * np.arange(len(state))
    return Motion(frames, frames / 15, state)


def swing(upper: float, up: int = 30, down: int = 30) -> Motion:
    """Rest, open, rest, close, rest; without closing when `down` is 0."""
    state = [0.0] * 4 + np.linspace(0, upper, up).tolist() + [upper] * 5
    return motion_of(state + (np.linspace(upper, 0, down).tolist() + [0.0] * 4 if down else []))


def shown(motion: Motion, start: float, goal: float, states: object) -> tuple[np.ndarray, np.ndarray]:
    k = matching_samples(motion, start, goal, np.asarray(states, dtype=float))
    return motion.frames[k], motion.state[k]


@pytest.mark.parametrize("closing", [False, True])
@pytest.mark.parametrize("recorded", ["opened and closed", "opened", "closed"])
def test_the_frame_has_the_state_in_the_robots_direction_where_one_is_recorded(
    closing: bool, recorded: str
) -> None:
    motion = swing(0.4, down=30 if recorded == "opened and closed" else 0)
    if recorded == "closed":
        motion = motion_of(motion.state[::-1])
    way = np.linspace(0.4, 0.0, 200) if closing else np.linspace(0.0, 0.4, 200)
    frames, states = shown(motion, way[0], way[-1], way)
    assert np.abs(states - way).max() <= 0.5 * 0.4 / 29 + 1e-12
    forward = recorded == "opened and closed" or (recorded == "closed") == closing
    assert np.all(np.diff(frames) >= 0) if forward else np.all(np.diff(frames) <= 0)
    assert len(set(frames.tolist())) == 30


def test_the_frame_stays_while_the_part_rests_and_goes_back_when_the_part_does() -> None:
    motion = swing(0.4)
    frames, states = shown(motion, 0.0, 0.4, [0.0] * 5 + [0.2, 0.4, 0.35, 0.35, 0.5, -0.1])
    assert len(set(frames[:5].tolist())) == 1
    assert frames[0] < frames[5] < frames[6]
    assert frames[7] == frames[8] < frames[6]
    assert frames[9] == frames[6], "beyond the goal its frame stays"
    assert states[10] == 0


def test_pauses_reversals_and_a_wrong_estimate_are_left_out() -> None:
    state = [*np.linspace(0, 0.2, 20), *[0.2] * 6, *np.linspace(0.19, 0.15, 5), *np.linspace(0.16, 0.4, 25)]
    state[10] = 0.39
    way = np.linspace(0, 0.4, 300)
    frames, states = shown(motion_of(state), 0.0, 0.4, way)
    assert np.all(np.diff(frames) >= 0)
    assert np.abs(states - way).max() < 0.02
    assert FIRST + 2 * 10 not in frames


def test_of_several_movements_the_first_whole_one_is_shown() -> None:
    half, whole = np.linspace(0, 0.2, 12), np.linspace(0, 0.4, 20)
    motion = motion_of([*half, *half[::-1], *whole, *whole[::-1], *whole])
    frames, _ = shown(motion, 0.0, 0.4, np.linspace(0, 0.4, 100))
    assert frames.min() >= FIRST + 2 * 23
    assert frames.max() == FIRST + 2 * 43
    frames, _ = shown(motion, 0.0, 0.2, np.linspace(0, 0.2, 100))
    assert frames.max() == FIRST + 2 * 11, "half the way is in the first movement already"
    motion = motion_of([*whole, *whole[::-1], *(1.005 * whole)])
    frames, _ = shown(motion, 0.0, 0.402, np.linspace(0, 0.402, 100))
    assert frames.max() == FIRST + 2 * 19, "an error of the states does not make a later one the whole one"


def test_a_little_closing_is_not_shown_for_the_whole() -> None:
    motion = motion_of([*np.linspace(0, 0.4, 30), *np.linspace(0.39, 0.3, 8)])
    _, states = shown(motion, 0.4, 0.0, [0.0, 0.1, 0.4])
    assert states == pytest.approx([0.0, 0.1, 0.4], abs=0.01)


@pytest.mark.parametrize("seed", range(8))
def test_matching_is_monotone_for_any_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = motion_of(np.cumsum(rng.normal(0.01, 0.05, 60)))
    start, goal = rng.permutation(np.quantile(motion.state, [0.1, 0.9]))
    way = np.linspace(start, goal, 100)
    frames, states = shown(motion, start, goal, way)
    steps = np.diff(frames)
    assert np.all(steps >= 0) or np.all(steps <= 0)
    assert np.all(np.sign(np.diff(states)) * np.sign(goal - start) >= 0)


@pytest.mark.parametrize("state", [[], [0.0], [0.0] * 5, [0.9, 0.95, 1.0]])
def test_a_motion_without_the_way_is_refused(state: list[float]) -> None:
    with pytest.raises(InputError, match=r"no frames of the way from 0\.000 to 0\.400"):
        matching_samples(motion_of(state), 0.0, 0.4, np.array([0.1]))


@pytest.mark.parametrize(
    ("height", "width"), [(97, 61), (480, 640), (61, 97), (1920, 1440), (31, 901), (3, 1)]
)
def test_images_of_any_shape_fit(height: int, width: int) -> None:
    image = np.full((height, width, 3), 200, np.uint8)
    panel = fitted(image, 121)
    assert panel.shape[0] == 121
    assert panel.shape[1] % 2 == 0
    assert panel.shape[1] <= 2 * 121
    lit = panel[:, panel.shape[1] // 2, 0] > 0
    assert lit.sum() / panel.shape[1] == pytest.approx(height / width, rel=0.35 if width < 9 else 0.05)
    assert set(np.unique(panel)) <= {0, 200}


def test_captions_add_a_line_and_leave_the_picture() -> None:
    image = np.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    made = captioned(image, "recording  42°")
    assert np.array_equal(made[:120], image)
    assert made.shape[0] % 2 == 0
    assert not np.array_equal(made, captioned(image, "recording  43°"))
    door, drawer = furniture.door().parts[0], furniture.drawer().parts[0]
    assert state_text(door, np.pi / 4) == "45°"
    assert state_text(drawer, 0.1234) == "123 mm"
    assert state_text(drawer, -1e-9) == "0 mm"


def test_the_pace_is_what_time_passes_in_the_film() -> None:
    assert pace_text(9.36, 130, 25) == "1.8 x real time"
    assert pace_text(11.0, 130, 25) == "2.1 x real time"
    assert pace_text(5.25, 130, 25) == "real time"
    assert pace_text(2.6, 130, 25) == "0.5 x real time"


def test_the_right_end_of_a_caption_never_meets_the_left_one() -> None:
    for width in (60, 161, 640):
        image = np.zeros((round(0.75 * width), width, 3), np.uint8)
        left, right = (
            captioned(image, "franka  120 mm"),
            captioned(image, "", "floor assumed, 1.6 x real time"),
        )
        both = captioned(image, "franka  120 mm", "floor assumed, 1.6 x real time")
        assert left.shape == right.shape == both.shape
        lit = np.flatnonzero((both[len(image) :, :, 0] > 90).any(axis=0))
        assert lit.max() < width
        gaps = np.diff(lit)
        if width == 640:
            assert gaps.max() > 50, "a wide picture keeps them apart"


def test_the_inset_lies_where_least_moves_and_leaves_the_rest() -> None:
    images = [np.full((90, 120, 3), 100, np.uint8) for _ in range(30)]
    for k, image in enumerate(images):
        image[:30, :40] = image[:30, -40:] = image[-30:, :40] = 8 * k  # all corners but one
    insets = [np.full((30, 40, 3), k, np.uint8) for k in range(30)]
    made = with_insets(images, insets)
    for k, (before, after) in enumerate(zip(images, made, strict=True)):
        assert (after[-28:-2, -38:-2] == k).all()
        assert (after[-30:-28, -40:] == 235).all(), "its frame"
        kept = np.ones((90, 120), bool)
        kept[-30:, -40:] = False
        assert np.array_equal(before[kept], after[kept])


@pytest.fixture(scope="module")
def recorded() -> Twin:
    twin = furniture.drawer()
    part = replace(twin.parts[0], motion=swing(twin.parts[0].joint.upper))
    return replace(twin, parts=(part,))


@pytest.fixture(scope="module")
def opening(recorded: Twin):
    return robots.plan(recorded, "part", config=FAST)


def demonstration(part: Part, shape: tuple[int, int] = (97, 61)) -> Demonstration:
    """Frames whose grey is the part's share of its range, and whose blue says that it closes."""
    states = dict(zip(part.motion.frames.tolist(), part.motion.state.tolist(), strict=True))
    top = int(part.motion.frames[np.argmax(part.motion.state)])

    def image(frame: int) -> np.ndarray:
        grey = 40 + round(180 * states[frame] / part.joint.upper)
        return np.full((*shape, 3), (grey, grey, 220 if frame > top + 8 else 40), dtype=np.uint8)

    return Demonstration(int(part.motion.frames[-1]) + 1, image)


def decoded(path: Path) -> np.ndarray:
    import av

    with av.open(str(path)) as container:
        assert container.streams.video[0].codec_context.pix_fmt == "yuv420p"
        assert container.streams.video[0].codec_context.name == "h264"
        return np.array([f.to_ndarray(format="rgb24") for f in container.decode(video=0)]).astype(float)


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
@pytest.mark.parametrize("goal", ["open", "close"])
def test_in_the_film_person_and_robot_have_the_part_at_one_state(
    recorded: Twin, opening, goal: str, tmp_path: Path
) -> None:
    part = recorded.parts[0]
    upper = part.joint.upper
    trajectory = opening if goal == "open" else robots.plan(recorded, "part", goal=goal, config=FAST)
    robots.replay(recorded, trajectory, tmp_path, config=SMALL, demonstration=demonstration(part))
    film = decoded(tmp_path / "replay.mp4")
    assert len(film) == SMALL.video_frames
    assert all(size % 2 == 0 for size in film.shape[1:3])
    person = film[:, 5:115, 5:70].mean(axis=(1, 2))
    world = build_world(
        recorded, robots.resolve("franka"), trajectory.T_world_base, trajectory.pedestal, visual=True
    )
    _, frames = simulate(world, trajectory, SMALL)
    states = frames[:, world.part_qpos[part.id]]
    assert np.ptp(states) > 0.9 * upper
    assert (person[:, :2].mean(axis=1) - 40) / 180 * upper == pytest.approx(states, abs=0.03 * upper)
    moving = (states > 0.05 * upper) & (states < 0.95 * upper)
    assert moving.sum() >= 3
    assert person[moving, 2] == pytest.approx(40 if goal == "open" else 220, abs=25)
    assert np.abs(film[0, :115, 80:] - film[-1, :115, 80:]).max() > 50, "and the robot moves beside it"


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_films_of_6_to_11_seconds_say_how_fast_they_run_and_that_nobody_saw_the_floor(
    recorded: Twin, opening, tmp_path: Path
) -> None:
    import av

    part, seconds = recorded.parts[0], opening.duration + SETTLE
    pace = pace_text(seconds, SMALL.video_frames, RATE)
    assert pace.startswith(f"{seconds * RATE / SMALL.video_frames:.2g} x")
    unseen = replace(opening, floor=Floor(0.0, "assumed"))
    for name, trajectory, told in (
        ("a", opening, None),
        ("b", opening, demonstration(part)),
        ("c", unseen, None),
    ):
        robots.replay(recorded, trajectory, tmp_path / name, config=SMALL, demonstration=told)
        with av.open(str(tmp_path / name / "replay.mp4")) as container:
            assert container.metadata["comment"] == pace
    height = SMALL.video_size[1]
    lines = {n: decoded(tmp_path / n / "replay.mp4")[0, height:, -161:] for n in "abc"}
    assert np.abs(lines["a"] - lines["b"][:, -lines["a"].shape[1] :]).mean() < 8, (
        "the same line, with the person or without"
    )
    assert np.abs(lines["a"] - lines["c"]).mean() > 8, "an assumed floor is in the picture"


@pytest.mark.skipif(not can_draw(), reason="no OpenGL without a screen on this machine")
def test_a_recording_that_does_not_fit_costs_its_half_of_the_film_alone(
    recorded: Twin, opening, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    short = replace(demonstration(recorded.parts[0]), frames=20)
    report = robots.replay(recorded, opening, tmp_path / "a", config=SMALL, demonstration=short)
    assert report.ok
    (warning,) = [r.message for r in caplog.records if r.levelname == "WARNING"]
    assert "shows the robot alone" in warning
    assert "the recording has 20 frames" in warning
    robots.replay(recorded, opening, tmp_path / "b", config=SMALL)
    assert decoded(tmp_path / "a" / "replay.mp4").shape == decoded(tmp_path / "b" / "replay.mp4").shape


def test_without_opengl_there_is_one_warning_as_ever(
    recorded: Twin, opening, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(*_args: object, **_kwargs: object) -> None:
        raise RuntimeError("no display")

    monkeypatch.setattr(mujoco, "Renderer", broken)
    report = robots.replay(
        recorded, opening, tmp_path, config=SMALL, demonstration=demonstration(recorded.parts[0])
    )
    assert report.ok
    assert report.video is None
    (warning,) = [r.message for r in caplog.records if r.levelname == "WARNING"]
    assert "no video" in warning


@pytest.mark.parametrize("wrong", [np.zeros((4, 4)), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)])
def test_what_is_no_colour_image_is_named(recorded: Twin, opening, wrong: np.ndarray) -> None:
    part = recorded.parts[0]
    bad = Demonstration(1000, lambda _: wrong)
    with pytest.raises(InputError, match=r"frame \d+ is .* with shape .*give \(H, W, 3\) uint8"):
        side_by_side([np.zeros((12, 12, 3), np.uint8)], np.zeros(1), opening, part, bad, "real time")
