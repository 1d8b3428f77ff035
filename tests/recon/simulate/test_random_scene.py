"""Random recordings: what they promise to hold, they hold, and their truth is that of the picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from recon.evaluation.read_truth import load_truth
from recon.simulate import simulate_random
from recon.simulate.hand import hand_shape, mirrored
from recon.simulate.mjcf import articulations
from recon.simulate.random import scene as random_scene
from recon.simulate.random.boards import box
from recon.simulate.random.fronts import HANDLES
from recon.simulate.random.furniture import KINDS
from recon.simulate.random.model import Placed, furniture_model
from recon.simulate.random.scene import Drawn, random_recording
from recon.simulate.random.strata import NEGATIVES, SENSORS, VIEWS, Stratum, sealed_set
from recon.simulate.random.witness import unfit
from recon.simulate.record import OTHER_LABEL
from recon.simulate.sensors import depth_camera
from recon.simulate.textures import make_material
from recon.simulate.timeline import Episode, Leg, Timeline
from tests.makers.recon.paint import plain_surfaces
from twin import geometry as geo
from twin.errors import ConfigError, InputError
from twin.geometry import Array, transform

SMALL = {"width": 96, "height": 72, "samples": 1, "ambient_samples": 1, "clutter": 0}
PLAIN = Stratum("ideal", size=(96, 72))


@pytest.fixture(scope="module", autouse=True)
def unpainted() -> Iterator[None]:
    """Nothing here looks at textures."""
    with plain_surfaces(8), pytest.MonkeyPatch.context() as patch:
        patch.setattr(random_scene, "unfit", lambda _: None)  # has a test of its own
        yield


@pytest.fixture
def rendering() -> Iterator[None]:
    with plain_surfaces():
        yield


@cache
def drawn(seed: int, stratum: Stratum) -> Drawn:
    return random_recording(seed, stratum, SMALL | {"room": False})


def pitch(poses: Array) -> Array:
    """Degrees that cameras (n, 4, 4) look upwards."""
    return np.degrees(np.arcsin(poses[:, 2, 2]))


def test_every_depth_camera_has_its_strata() -> None:
    assert set(SENSORS) == set(depth_camera.SENSORS)


def test_the_sealed_set_is_balanced() -> None:
    strata = sealed_set()
    ordinary, hard, negative = strata[:60], strata[60:120], strata[120:]
    assert set(Counter(s.sensor for s in ordinary).values()) == {20}
    assert {s.view for s in ordinary} == {"ordinary"}
    assert not any(s.hard_picture for s in ordinary)
    for field, values in (("sensor", SENSORS), ("view", VIEWS), ("hard_picture", (True, False))):
        counts = Counter(getattr(s, field) for s in hard)
        assert set(counts) == set(values)
        assert set(counts.values()) == {60 // len(values)}
    assert Counter(s.negative for s in negative) == dict.fromkeys(NEGATIVES, 5)
    positive = [*ordinary, *hard]
    assert sum(s.short for s in positive) == 24
    assert sum(s.size != (640, 480) for s in positive) == sum(s.fps == 30 for s in positive) == 6


@pytest.mark.usefixtures("rendering")
def test_equal_seeds_give_equal_recordings_and_others_do_not() -> None:
    one, again = (random_recording(5, PLAIN, SMALL | {"room": False}).stage for _ in range(2))
    assert one.config == again.config
    assert one.script.episodes == again.script.episodes
    k = one.frames // 2
    np.testing.assert_array_equal(one.render(k).colour, again.render(k).colour)
    assert drawn(6, PLAIN).stage.script.episodes != one.script.episodes


def test_what_is_asked_for_is_drawn() -> None:
    steep = drawn(3, replace(PLAIN, view="steep")).stage
    looks = pitch(steep.cameras[steep.acts[0].line.grasp : steep.acts[0].line.release])
    assert np.median(looks) < -28 or np.median(looks) > 15
    moving = drawn(4, replace(PLAIN, view="moving")).stage
    assert np.linalg.norm(np.diff(moving.cameras[:, :3, 3], axis=0), axis=1).sum() > 0.6
    short = drawn(5, replace(PLAIN, short=True)).stage
    way = float(np.ptp(short.acts[0].states))
    low, high = (0.06, 0.10) if short.parts[0].kind == "prismatic" else (np.radians(12.0), np.radians(20.0))
    assert low - 1e-9 <= way <= high + 1e-9
    hard = drawn(6, replace(PLAIN, hard_picture=True, sensor="stereo")).stage.config
    assert hard.sensor == "stereo"
    assert hard.picture != type(hard.picture)(jpeg_quality=hard.picture.jpeg_quality)


def test_what_nobody_could_record_is_drawn_again() -> None:
    stage = drawn(5, PLAIN).stage
    assert unfit(stage) is None
    away = copy(stage)
    away.cameras = stage.cameras @ geo.make_pose(geo.exp_so3(np.array([0.0, np.pi, 0.0])))
    assert unfit(away) == "what moves is hardly in view"
    away.cameras = stage.cameras @ geo.make_pose(translation=[0.0, 0.0, -5.0])
    assert unfit(away) is not None
    middle = stage.parts[0].part[0].vertices[0]
    away.cameras = stage.cameras.copy()
    away.cameras[:, :3, 3] = middle
    assert unfit(away) == "the camera meets a surface"


def test_the_hand_holds_the_part_it_leads() -> None:
    stage = drawn(8, PLAIN).stage
    truth = stage.truth()
    held = [p for p in truth.parts if p.held.any()]
    assert held
    for part in held:
        for i in np.flatnonzero(part.held)[::5]:
            grip = transform(part.part.pose(float(part.states[i])), part.grasp.point[None])[0]
            assert np.linalg.norm(truth.keypoints[i][[8, 12, 16, 20]] - grip, axis=1).max() < 0.07


@pytest.mark.usefixtures("rendering")
def test_a_written_recording_has_the_truth_of_its_pictures(tmp_path: Path) -> None:
    out = simulate_random(
        8, tmp_path / "clip", replace(PLAIN, view="near"), SMALL | {"room": False, "frames": 24}
    )
    truth = load_truth(out / "truth")
    assert truth.frames == len(list((out / "depth").iterdir()))
    assert (out / "truth" / "random.json").is_file()
    for part in truth.parts:
        assert np.ptp(part.states) > 0
        assert part.span is not None
        seen = [k for k in range(0, truth.frames, 4) if np.any(truth.labels[k] == part.id)]
        assert seen
    with pytest.raises(InputError, match="not an empty folder"):
        simulate_random(8, out, PLAIN, SMALL)
    with pytest.raises(ConfigError, match="widht"):
        simulate_random(8, tmp_path / "other", PLAIN, {"widht": 64})


@pytest.mark.parametrize("kind", NEGATIVES)
def test_in_a_negative_nothing_is_a_part(kind: str) -> None:
    stage = drawn(11, replace(PLAIN, negative=kind)).stage
    assert stage.truth().parts == ()
    others = [a for a in stage.actors if a.T_world_body is not stage.hand.T_world_hand]
    labels = {a.body(0).label for a in others}
    assert (OTHER_LABEL in labels) == (kind in ("carried", "curtain", "person", "screen"))
    assert any(stage.hand.present) == (kind in ("carried", "gestures", "rattle"))
    states = np.concatenate([a.states for a in stage.acts]) if kind != "carried" else np.zeros(1)
    assert np.ptp(states) <= (0.008 if kind == "rattle" else 0.0)
    rigid = [a for a in others if a.body(0).label == OTHER_LABEL]
    moved = max((float(np.ptp(a.T_world_body[:, :3, 3], axis=0).max()) for a in rigid), default=0.0)
    assert (moved > 0.05) == (kind in ("carried", "person", "curtain"))


def test_legs_with_pauses_and_back_again() -> None:
    legs = (Leg(0.2, 1.0), Leg(0.2, 0.5), Leg(0.3, 1.0), Leg(0.0, 1.0))
    levels = Episode("j", 0.1, legs, 1.0, 1.0, 0.2, 1.0).levels
    line = Timeline(5, 10, (12, 22, 27, 37, 47), 49, 55, 60)
    states = line.states(levels)
    np.testing.assert_allclose(
        states[[0, 12, 22, 25, 27, 37, 47, 59]], [0.1, 0.1, 0.2, 0.2, 0.2, 0.3, 0.0, 0.0], atol=1e-12
    )
    assert line.segments(levels) == [(12, 22), (27, 37), (37, 47)]
    assert line.segments((0.1, 0.2, 0.3, 0.3, 0.3)) == [(12, 27)]


def test_the_left_hand_is_the_right_one_mirrored() -> None:
    right = hand_shape(1.0, make_material("skin", 1.0, np.random.default_rng(0)), spacing=0.008)
    left = mirrored(right)
    volumes = [_volume(h.surface.vertices[h.surface.faces]) for h in (right, left)]
    assert volumes[0] == pytest.approx(volumes[1])
    assert abs(volumes[0]) > 1e-4
    again = mirrored(left)
    np.testing.assert_array_equal(again.surface.vertices, right.surface.vertices)
    np.testing.assert_array_equal(again.surface.faces, right.surface.faces)


def _volume(triangles: Array) -> float:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize("handle", HANDLES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_draw_makes_furniture_that_ends_behind_its_front(kind: str, handle: str) -> None:
    """The lowest drawers with an overhanging front leave no height for sides: one draw of 400 had ended in an
    error."""
    rng = np.random.default_rng(3)
    for _ in range(400):
        made = KINDS[kind](rng, handle)
        if kind.startswith("drawer"):
            front, *rest = (b.corners for b in made.panels)
            assert np.ptp(np.concatenate(rest)[:, 2]) < np.ptp(front[:, 2])


def test_each_piece_is_furniture_of_its_own_without_its_neighbours() -> None:
    rng = np.random.default_rng(3)
    pieces = [
        Placed(n, KINDS["door_left"](rng, "bar"), np.array([x, 0.0, 0.0]))
        for n, x in (("a", 0.0), ("b", 2.0))
    ]
    pieces = [
        replace(p, made=replace(p.made, around=[box([0.9, 0.3, 0.5], [0.2, 0.5, 1.0])])) for p in pieces
    ]
    model = furniture_model(pieces, rng, weak_fronts=False)
    parts = articulations(model, "random", ("a", "b"), (), 1.0, rng)
    for piece, part in zip(pieces, parts, strict=True):
        found = np.concatenate([s.vertices for s in part.furniture])
        true = np.concatenate([b.corners for b in piece.made.carcass]) + piece.shift
        np.testing.assert_allclose(
            np.unique(found.round(6), axis=0), np.unique(true.round(6), axis=0), atol=1e-6
        )


@pytest.mark.parametrize("kind", KINDS)
def test_furniture_keeps_clear_of_the_way_of_its_part(kind: str) -> None:
    rng = np.random.default_rng(2)
    made = KINDS[kind](rng, "bar")
    model = furniture_model([Placed("j", made, np.zeros(3))], rng, weak_fronts=False)
    assert model.njnt == 1
    assert model.joint(0).name == "j"
    np.testing.assert_allclose(model.jnt_range[0], [made.joint.lower, made.joint.upper])
    beside = model.body("beside").id
    swept = np.concatenate(
        [
            transform(made.joint.pose(s), b.corners)[None]
            for s in np.linspace(0, made.joint.upper, 9)
            for b in made.part
        ]
    )
    for geom in np.flatnonzero(model.geom_bodyid == beside):
        low, high = model.geom_pos[geom] - model.geom_size[geom], model.geom_pos[geom] + model.geom_size[geom]
        inside = np.minimum(high, swept.max(axis=1)) - np.maximum(low, swept.min(axis=1))
        assert not np.any(np.all(inside > 2e-3, axis=1))


def test_a_seed_that_nobody_could_record_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_scene, "MOST_DRAWS", 1)
    monkeypatch.setattr(random_scene, "unfit", lambda _: "the arm is too short")
    with pytest.raises(InputError, match="arm is too short"):
        random_recording(1, PLAIN, SMALL)
