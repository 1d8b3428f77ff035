"""Random walks: what they promise to hold, they hold, and their truth is that of the picture."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.evaluation.read_truth import load_truth
from recon.simulate import simulate_walk
from recon.simulate.random.strata import SENSORS, WalkStratum, sealed_walks
from recon.simulate.record import OTHER_LABEL, PART_ID
from recon.simulate.walk import scene as walk_scene
from recon.simulate.walk.cameras import turning
from recon.simulate.walk.events import Wishes
from recon.simulate.walk.floor import SQUEEZE, Floor, path_length
from recon.simulate.walk.journey import floor_of
from recon.simulate.walk.layout import FRONT_ROOM, draw_layout
from recon.simulate.walk.plan import SLACK, draw_plan, others_of
from recon.simulate.walk.scene import DrawnWalk, random_walk
from recon.simulate.walk.solids import Solids, meets
from recon.simulate.walk.witness import grip_in_view
from tests.makers.recon.paint import plain_surfaces
from twin import geometry as geo
from twin.errors import ConfigError, InputError
from twin.geometry import transform
from twin.scene import Box

SMALL = {"width": 96, "height": 72, "samples": 1, "ambient_samples": 1, "clutter": 2, "fps": 6.0}
PLAIN = WalkStratum("ideal", parts=3, interactions=4, seconds=45.0)
EVERYTHING = Wishes({1: 2.5}, (1,), (2,), 3, True, True)


@pytest.fixture(scope="module", autouse=True)
def unpainted() -> Iterator[None]:
    """Nothing here looks at textures."""
    with plain_surfaces(8):
        yield


@pytest.fixture
def rendering() -> Iterator[None]:
    with plain_surfaces():
        yield


@cache
def walked(seed: int, stratum: WalkStratum = PLAIN) -> DrawnWalk:
    return random_walk(seed, stratum, settings=SMALL)


@cache
def eventful() -> DrawnWalk:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walk_scene, "draw_wishes", lambda *_: EVERYTHING)
        return random_walk(9, replace(PLAIN, seconds=90.0), settings=SMALL)


def test_the_sealed_walks_are_balanced() -> None:
    strata = sealed_walks()
    assert len(strata) == 16
    assert sum(s.parts for s in strata) >= 48
    assert sum(s.interactions for s in strata) >= 90
    assert all(3 * (s.interactions - s.parts) >= s.parts for s in strata)
    assert {s.seconds for s in strata} == {45.0 + 5.0 * k for k in range(16)}
    assert {(s.size, s.fps) for s in strata} == {((640, 480), 15.0)}
    for field in ("order", "loops", "hard_picture"):
        assert set(Counter(getattr(s, field) for s in strata).values()) == {8}
    assert set(Counter(s.sensor for s in strata)) == set(SENSORS)
    assert set(Counter((s.order, s.loops, s.hard_picture) for s in strata).values()) == {2}


def test_boxes_meet_where_their_volumes_do() -> None:
    def solid(centre: list[float], turn: list[float]) -> Solids:
        return Solids.of([Box(geo.make_pose(geo.exp_so3(np.array(turn)), centre), np.ones(3))])

    one = solid([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    for shift, turn, there in (
        ([0.9, 0.0, 0.0], [0.0, 0.0, 0.0], True),
        ([1.1, 0.0, 0.0], [0.0, 0.0, 0.0], False),
        ([1.15, 0.0, 0.0], [0.0, 0.0, np.pi / 4], True),
        ([1.25, 0.0, 0.0], [0.0, 0.0, np.pi / 4], False),
        ([1.15, 1.15, 0.0], [0.0, 0.0, np.pi / 4], False),  # bounds meet, boxes don't
    ):
        assert meets(one, solid(shift, turn), 1e-3) == there


def test_rooms_are_furnished_along_their_walls() -> None:
    walls = set()
    for seed in range(12):
        layout = draw_layout(np.random.default_rng(seed))
        pieces = [s for s in layout.stands if s.piece.cells]
        assert 3 <= len(layout.stands) + (layout.loose is not None) <= 8
        assert len(pieces) >= 2
        rows = Counter(c.row for s in pieces for c in s.piece.cells)
        assert max(rows.values()) >= 2  # fronts that look alike
        walls.add(len({tuple(s.outward.round().tolist()) for s in pieces}))
        for k, one in enumerate(layout.stands):
            low, high = one.closed.bounds
            assert np.all(low[:2] > layout.low[:2] - 1e-6)
            assert np.all(high[:2] < layout.high[:2] + 1e-6)
            assert not any(meets(one.closed, other.closed, 1e-3) for other in layout.stands[:k])
            before = Solids.of(
                [
                    Box(
                        geo.make_pose(translation=one.middle + 0.5 * FRONT_ROOM * one.outward),
                        one.closed.bounds[1] - one.closed.bounds[0],
                    )
                ]
            )
            if one.piece.cells:
                assert not any(meets(before, o.closed, 0.05) for o in layout.stands if o is not one)
    assert walls >= {2}
    assert walls <= {2, 3, 4}


def test_parts_on_their_ways_meet_nothing() -> None:
    hidden = 0
    for seed in range(14):
        rng = np.random.default_rng(seed)
        layout = draw_layout(rng)
        plan = draw_plan(rng, layout, replace(PLAIN, parts=5, interactions=8))
        if plan is None:
            continue
        times = Counter(e.joint for e in plan.episodes)
        assert len(times) == 5
        assert sum(n > 1 for n in times.values()) >= 2
        for k, episode in enumerate(plan.episodes):
            states = plan.states(k)
            assert episode.start == states[episode.joint]
            stand, cell = layout.cells[episode.joint]
            assert 0.0 <= min(episode.levels) <= max(episode.levels) <= cell.front.joint.upper + 1e-9
            others = others_of(layout, episode.joint, states)
            assert not any(meets(stand.part(cell, s), others, SLACK) for s in episode.levels)
            hidden += cell.behind is not None
            assert cell.behind is None or states[cell.behind] > 1.5
    assert hidden > 0


def test_ways_lead_round_what_stands_there() -> None:
    low, high = np.zeros(3), np.array([4.0, 3.0, 2.5])
    wall = Box(geo.make_pose(translation=[2.0, 1.0, 0.5]), np.array([0.1, 2.0, 1.0]))
    floor = Floor.of(low, high, Solids.of([wall]))
    way = floor.way(np.array([1.0, 0.5]), np.array([3.0, 0.5]))
    assert way is not None
    np.testing.assert_allclose(way[[0, -1]], [[1.0, 0.5], [3.0, 0.5]])
    assert floor.clearance(way).min() > SQUEEZE
    assert path_length(way) < 1.5 * (2.0 * np.hypot(1.0, 1.5))
    across = Box(geo.make_pose(translation=[2.0, 1.5, 0.5]), np.array([0.1, 3.2, 1.0]))
    assert Floor.of(low, high, Solids.of([across])).way(np.array([1.0, 0.5]), np.array([3.0, 0.5])) is None


def test_a_person_walks_looks_and_reaches_as_people_do() -> None:
    stage = walked(3).stage
    fps, eyes = stage.config.fps, stage.cameras[:, :3, 3]
    assert len(eyes) == 45 * 6
    assert turning(stage.cameras, fps).max() < 60.0 or any(
        e["kind"] == "fast_turn" for e in stage.journey.events
    )
    speed = np.linalg.norm(np.diff(eyes[:, :2], axis=0), axis=1) * fps
    assert speed.max() < 1.0
    assert speed.sum() / fps > 3.0
    for act in stage.acts:
        held = range(act.line.grasp, act.line.release + 1)
        assert max(stage.shoulder_distance(k) for k in held) < 1.0
        assert grip_in_view(stage, act) > 0.5
    floor = floor_of(stage.room, {})
    assert floor.clearance(eyes[:, :2]).min() > 0.1  # never inside furniture


def test_the_whole_room_is_seen() -> None:
    stage = walked(3).stage
    for stand in (s for s in stage.room.layout.stands if s.piece.cells):
        points = transform(
            geo.invert_pose(stage.cameras), np.broadcast_to(stand.middle, (len(stage.cameras), 1, 3))
        )
        pixels = stage.camera.project(points[:, 0])
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels > 0) & (pixels < [96, 72]), axis=1)
        assert inside.any(), stand.name


def test_states_agree_with_segments_and_hands() -> None:
    stage = walked(3).stage
    truth = stage.truth()
    assert len(truth.parts) == 3
    assert sum(len(p.segments) > 1 for p in truth.parts) >= 1  # handled again
    for part in truth.parts:
        moving = np.zeros(stage.frames, dtype=bool)
        for first, last in part.segments:
            moving[first:last] = True
        steps = np.abs(np.diff(part.states))
        assert np.all(steps[~moving[:-1]] == 0.0)
        assert all(abs(part.states[b] - part.states[a]) > 0.0 for a, b in part.segments)
        assert np.all(part.held[:-1][steps > 0.0])
        for k in np.flatnonzero(part.held)[::3]:
            grip = transform(part.part.pose(float(part.states[k])), part.grasp.point[None])[0]
            assert np.linalg.norm(truth.keypoints[k][[8, 12, 16, 20]] - grip, axis=1).max() < 0.07


def test_an_arm_comes_from_behind_the_lens() -> None:
    """A hand that is still behind the shoulder is not shown; one that holds a part is."""
    for seed in (20, 24):
        stage = walked(seed).stage
        hand, cameras = stage.hand, stage.cameras
        present = np.array(hand.present)
        along = np.einsum("ni,ni->n", hand.T_world_arm[:, :3, 1], cameras[:, :3, 2])
        assert (along[present] < 0).all()
        for act in stage.acts:
            assert present[act.line.grasp : act.line.release + 1].all()


def test_some_frames_of_a_walk_have_the_truth_of_these_frames() -> None:
    whole = walked(3).stage
    act = whole.acts[1]
    first, last = act.line.enter - 2, act.line.gone + 2
    some, all_ = whole.during(first, last).truth(), whole.truth()
    frames = slice(first, last + 1)
    assert np.array_equal(some.cameras, all_.cameras[frames])
    assert np.array_equal(some.keypoints, all_.keypoints[frames])
    for part, known in zip(some.parts, all_.parts, strict=True):
        assert np.array_equal(part.states, known.states[frames])
        assert np.array_equal(part.held, known.held[frames])
        inside = [(a - first, b - first) for a, b in known.segments if a >= first and b <= last]
        assert list(part.segments) == inside
    assert {p.part.name for p in some.parts if p.segments} == {act.scene.name}
    again = whole.during(first, last).during(2, 5)
    assert np.array_equal(again.truth().cameras, all_.cameras[first + 2 : first + 6])
    with pytest.raises(ValueError, match="none of"):
        whole.during(0, whole.frames)


@pytest.mark.usefixtures("rendering")
def test_labels_are_where_the_moved_meshes_are() -> None:
    stage = random_walk(3, PLAIN, settings=SMALL).stage
    for act in stage.acts:
        number = next(k for k, p in enumerate(stage.room.parts) if p.name == act.scene.name)
        k = act.line.end
        labels = stage.render(k).labels
        vertices = np.concatenate([s.vertices for s in act.scene.part])
        placed = transform(act.scene.pose(float(act.states[k])), vertices)
        pixels = stage.camera.project(transform(geo.invert_pose(stage.cameras[k]), placed))
        rows, columns = np.nonzero(labels == PART_ID + number)
        assert len(rows) > 20
        assert columns.min() > np.nanmin(pixels[:, 0]) - 1.5
        assert columns.max() < np.nanmax(pixels[:, 0]) + 1.5
        assert rows.min() > np.nanmin(pixels[:, 1]) - 1.5
        assert rows.max() < np.nanmax(pixels[:, 1]) + 1.5


def test_what_happens_besides_is_told_and_takes_its_time() -> None:
    stage = eventful().stage
    events = {e["kind"]: e["frames"] for e in stage.journey.events}
    assert {"pause", "covered_lens", "fast_turn", "empty_hand"} <= set(events)
    assert any(kind.startswith("chair_moved") or kind == "carried" for kind in events)
    fps, cameras = stage.config.fps, stage.cameras
    first, last = events["pause"]
    assert np.linalg.norm(np.diff(cameras[first:last, :2, 3], axis=0), axis=1).max() * fps < 0.25
    first, last = events["fast_turn"]
    assert 80.0 < turning(cameras, fps)[max(0, first - 1) : last + 1].max() < 130.0
    first, last = events["covered_lens"]
    assert all(stage.covered(k) for k in range(first, last + 1))
    assert not stage.covered(first - 1)
    assert not any(stage.hand.present[first : last + 1])
    first, last = events["empty_hand"]
    assert any(stage.hand.present[first:last])
    assert not any(p.held[first:last].any() for p in stage.truth().parts)
    moved = [a for a in stage.actors if a.body(0).label == OTHER_LABEL]
    assert moved
    assert all(np.ptp(a.T_world_body[:, :3, 3], axis=0).max() > 0.1 for a in moved)


@pytest.mark.usefixtures("rendering")
def test_equal_seeds_give_equal_bytes(tmp_path: Path) -> None:
    few, settings = replace(PLAIN, parts=2, interactions=3), SMALL | {"frames": 12}
    folders = [simulate_walk(7, tmp_path / n, few, 25.0, settings) for n in ("a", "b")]
    files = [sorted(p.relative_to(f) for p in f.rglob("*") if p.is_file()) for f in folders]
    assert files[0] == files[1]
    assert all((folders[0] / p).read_bytes() == (folders[1] / p).read_bytes() for p in files[0])
    truth = load_truth(folders[0] / "truth")
    assert truth.frames == 12
    assert [p.id for p in truth.parts] == [2, 3]
    told = json.loads((folders[0] / "truth" / "random.json").read_text())
    assert told["walk"]["seconds"] == 25.0
    assert len(told["episodes"]) == 3
    assert walked(3).to_json(3)["episodes"] != told["episodes"]


@pytest.mark.usefixtures("rendering")
def test_a_covered_lens_sees_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def covered(_: object, __: object, frames: int, ___: object) -> np.ndarray:
        return np.arange(frames) == 1

    monkeypatch.setattr(walk_scene, "cover_lens", covered)
    monkeypatch.setattr(walk_scene, "draw_wishes", lambda *_: Wishes({}, (), (), None, True, False))
    out = simulate_walk(
        3, tmp_path / "walk", replace(PLAIN, sensor="phone_lidar"), settings=SMALL | {"frames": 12}
    )
    read = [cv2.imread(str(out / f / "000001.png"), cv2.IMREAD_UNCHANGED) for f in ("depth", "truth/labels")]
    assert not any(np.any(image) for image in read)
    assert cv2.imread(str(out / "color" / "000001.jpg")).mean() < 20
    assert cv2.imread(str(out / "color" / "000002.jpg")).mean() > 40
    assert np.any(cv2.imread(str(out / "depth" / "000002.png"), cv2.IMREAD_UNCHANGED))


def test_what_can_not_be_walked_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="9 s"):
        random_walk(1, seconds=9.0)
    with pytest.raises(ConfigError, match="more than the walk's"):
        random_walk(3, PLAIN, settings=SMALL | {"frames": 5000})
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="not an empty folder"):
        simulate_walk(1, tmp_path)
