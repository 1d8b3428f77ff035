"""Up by all that is known of the world, which is turned by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.contact.up.decide import ODDS, Upright, World, find_up, turned
from recon.recording.said import Said
from tests.makers.recon.steep import Steep, steep
from twin import geometry as geo

Z = np.array([0.0, 0.0, 1.0])
UNSAID = Said()


def decided(seen: Steep, said: Said = UNSAID) -> Upright:
    return find_up(seen.recording, seen.world, {}, said)


def off_deg(seen: Steep, up: np.ndarray) -> float:
    return float(np.degrees(geo.angle_between(up, seen.up)))


@pytest.mark.parametrize("pitch", [46.0, 48.0, 50.0])
def test_a_wall_is_not_taken_for_the_floor_where_the_camera_looks_down_steeply(pitch: float) -> None:
    """By its posture alone the camera looks up at a ceiling: the drawer's travel and the fronts say that it
    doesn't."""
    seen = steep(pitch)
    assert off_deg(seen, Z) == pytest.approx(90.0, abs=1.0)
    told = decided(seen)
    assert off_deg(seen, told.up) < 1.0
    assert told.doubt is None
    world = turned(seen.world, told.up)
    assert abs(world.parts[0].joint.axis[2]) < 0.02


@pytest.mark.parametrize("pitch", [22.0, 30.0, 40.0])
def test_a_world_that_stands_is_not_touched(pitch: float) -> None:
    seen = steep(pitch)
    told = decided(seen)
    assert np.array_equal(told.up, Z)
    assert told.doubt is None
    assert turned(seen.world, told.up) is seen.world


def in_view(world: World) -> list[np.ndarray]:
    """What doesn't depend on the world: all that stands in it, in the first camera."""
    T = geo.invert_pose(world.cameras.T_world_cam[0])
    (one,) = world.interactions
    tracks = [t.part for t in one.found.parts]
    out = [geo.transform(T, world.fused.static.vertices), geo.transform(T, one.found.movers.points_world)]
    out += [geo.transform(T, m.vertices) for m in world.fused.parts.values()]
    for part in (*world.parts, *one.parts, *tracks):
        out += [T @ part.joint.pose(0.2) @ geo.invert_pose(T)]
    return out


def test_what_is_seen_stays_where_the_camera_sees_it_when_the_world_is_turned() -> None:
    seen = steep(50.0)
    world = turned(seen.world, decided(seen).up)
    for before, after in zip(in_view(seen.world), in_view(world), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-9)


def test_a_direction_that_is_hardly_more_likely_is_doubted_and_both_are_named() -> None:
    """Without a part, straight below: floor and wall are as likely as ceiling and wall."""
    seen = steep(62.0, with_part=False)
    told = decided(seen)
    assert told.doubt.type == "UpUnsure"
    assert told.doubt.level == "doubtful"
    assert 1.0 <= told.doubt.numbers["odds"] < ODDS
    words = [told.doubt.numbers["taken"], told.doubt.numbers["other"]]
    assert all(f"--up {word}" in told.doubt.help for word in words)
    said = [np.array([float(v) for v in word.split(",")]) for word in words]
    start = geo.rotate(np.linalg.inv(seen.world.cameras.T_world_cam[0]), seen.up)
    assert min(np.degrees(geo.angle_between(v, start)) for v in said) < 10.0  # as near as --up needs it


def test_the_user_and_the_device_are_not_contradicted() -> None:
    seen = steep(50.0)
    assert np.array_equal(decided(seen, Said(up="-y")).up, Z)
    told = replace(seen, recording=replace(seen.recording, gravity_camera0=np.array([0.0, 1.0, 0.0])))
    assert np.array_equal(decided(told).up, Z)
    assert decided(told).doubt is None


def test_a_view_without_walls_and_floors_is_doubted() -> None:
    seen = steep(20.0)
    blind = replace(seen.recording, read_depth=lambda i: np.zeros_like(seen.recording.depth(i)))
    told = decided(replace(seen, recording=blind))
    assert np.array_equal(told.up, Z)
    assert told.doubt is not None
    assert "too little is seen" in told.doubt.text
