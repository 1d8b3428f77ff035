"""Fused meshes against exact truth, and the laws of the distance field."""

from __future__ import annotations

import numpy as np
import pytest

from recon.dense.noise import GOOD_SENSOR
from recon.evaluation.metrics import DistanceField
from recon.evaluation.read_truth import load_truth
from recon.evaluation.surface_scores import sampled
from recon.evaluation.truth import Truth
from recon.fusion.fuse import FusedScene, FusionConfig, _bin, _median, fuse
from recon.fusion.mesh_cleaning import reduce_faces, smooth
from recon.fusion.observation import Observation, own_points
from recon.fusion.tsdf import Field, allocate, integrate, ray_cosine, surface
from recon.readers import open_recording
from recon.recording import Intrinsics, Recording
from tests.makers.recon.tiny import box, write_recording
from tests.recon.interaction.labels.test_labels import true_parts
from twin.errors import ConfigError, ReconstructionError
from twin.geometry import Array
from twin.scene import Trajectory

CAMERA = Intrinsics(160, 120, 200.0, 200.0, 79.5, 59.5)


def allocated(clouds: list[Array], voxel: float, margin: float) -> Field:
    points = np.concatenate(clouds)
    return allocate(points.min(axis=0), points.max(axis=0), clouds, voxel, margin)


def plane(tilt: float, distance: float = 1.0) -> tuple[Array, Array]:
    """Depth (120, 160) of a plane turned by `tilt` rad about the camera's y axis through (0, 0, distance);
    its normal."""
    x = (np.arange(160) - CAMERA.cx) / CAMERA.fx
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    depth = distance * np.cos(tilt) / (normal[0] * x + normal[2])
    return np.tile(depth, (120, 1)).astype(np.float32), normal


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Truth, FusedScene]:
    folder = write_recording(tmp_path_factory.mktemp("fusion") / "r", ("door",), scale=3)
    recording, truth = open_recording(folder), load_truth(folder)
    labels = {f: truth.labels[f] for f in range(0, 30, 3)}
    fused = fuse(recording, truth.cameras, labels, true_parts(truth, recording.times))
    return recording, truth, fused


def test_meshes_lie_on_the_true_surfaces(door: tuple[Recording, Truth, FusedScene]) -> None:
    _, truth, fused = door
    part = truth.part(2)
    found = fused.parts[2]
    assert DistanceField(part.mesh).distance(sampled(found)).mean() < 0.003
    assert DistanceField(truth.static).distance(sampled(fused.static)).mean() < 0.004


def test_the_part_has_the_sides_that_opening_shows(door: tuple[Recording, Truth, FusedScene]) -> None:
    _, _, fused = door
    found = DistanceField(fused.parts[2])
    front = np.array([[x, 0.55, z] for x in np.linspace(-0.45, -0.2, 6) for z in np.linspace(1.1, 1.5, 6)])
    edge = np.array([[-0.1, 0.56, z] for z in np.linspace(1.1, 1.5, 9)])
    assert found.distance(front).max() < 0.01
    assert found.distance(edge).max() < 0.012


def test_budgets_and_colours(door: tuple[Recording, Truth, FusedScene]) -> None:
    recording, truth, fused = door
    labels = {f: truth.labels[f] for f in range(0, 30, 5)}
    parts = true_parts(truth, recording.times)
    small = fuse(recording, truth.cameras, labels, parts, FusionConfig(part_faces=200, static_faces=500))
    assert 100 < len(small.parts[2].faces) <= 200
    assert 250 < len(small.static.faces) <= 500
    colors = fused.parts[2].colors
    assert colors is not None
    # the part is drawn in shades of (150 + n, 150 + n, 150 + n) or its like: seen vertices are not left grey
    # by default
    assert len(np.unique(colors, axis=0)) > 20


def test_what_can_not_be_fused_says_so(door: tuple[Recording, Truth, FusedScene]) -> None:
    recording, truth, _ = door
    parts = true_parts(truth, recording.times)
    nothing = {0: np.zeros((recording.intrinsics.height, recording.intrinsics.width), np.uint8)}
    with pytest.raises(ReconstructionError, match="static surface"):
        fuse(recording, truth.cameras, nothing, parts)
    late = Trajectory(truth.cameras.frames[5:], truth.cameras.times[5:], truth.cameras.T_world_cam[5:])
    with pytest.raises(ReconstructionError, match="camera pose"):
        fuse(recording, late, nothing, parts)
    with pytest.raises(ConfigError, match=r"part_voxel = 0\.0 must be above 0 m"):
        FusionConfig(part_voxel=0.0)
    seen = fuse(recording, truth.cameras, {0: np.where(truth.labels[0] == 1, 1, 0).astype(np.uint8)}, parts)
    assert seen.parts == {}


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 55.0])
def test_cosine_of_a_plane_is_exact(tilt_deg: float) -> None:
    depth, normal = plane(np.deg2rad(tilt_deg))
    rays = np.stack([(np.arange(160) - CAMERA.cx) / CAMERA.fx, np.zeros(160), np.ones(160)], axis=1)
    true = np.abs(rays @ normal) / np.linalg.norm(rays, axis=1)
    cosine = ray_cosine(depth, CAMERA.vector, 3, GOOD_SENSOR.curve)[60]
    assert cosine[20:140] == pytest.approx(true[20:140], abs=0.01)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 55.0])
def test_a_plane_is_fused_where_it_is(tilt_deg: float) -> None:
    depth, normal = plane(np.deg2rad(tilt_deg))
    own = np.zeros(depth.shape, bool)
    own[20:100, 40:120] = True
    seen = Observation(depth, own, ray_cosine(depth, CAMERA.vector, 3, GOOD_SENSOR.curve), CAMERA, np.eye(4))
    field = allocated([own_points(seen, 1)], 0.005, 0.015)
    integrate(field, [seen], 0.015, 0.5, GOOD_SENSOR.curve)
    vertices, faces = surface(field, 1e-6)
    assert len(faces) > 100
    assert np.abs((vertices - [0, 0, 1.0]) @ normal).max() < 0.003
    assert len(np.unique(np.round(vertices, 7), axis=0)) == len(vertices)


def test_what_others_see_through_is_carved_away() -> None:
    near, far = plane(0.0, 0.9)[0], plane(0.0, 1.2)[0]
    own = np.ones(near.shape, bool)
    cosine = np.ones(near.shape, np.float32)
    ghost = Observation(near, own, cosine, CAMERA, np.eye(4))
    through = Observation(far, ~own, cosine, CAMERA, np.eye(4))
    field = allocated([own_points(ghost, 2)], 0.01, 0.03)
    integrate(field, [ghost], 0.03, 0.5, GOOD_SENSOR.curve)
    assert len(surface(field, 1e-6)[1]) > 0
    integrate(field, [through] * 12, 0.03, 0.5, GOOD_SENSOR.curve)
    assert len(surface(field, 1e-6)[1]) == 0


def test_frames_are_averaged_in_their_order_however_many_are_in_memory() -> None:
    """A field of a cloud in pieces is that of all its points; more frames than memory holds at a time are
    averaged as they come."""
    seen = []
    for k in range(70):
        depth = plane(0.01 * k, 1.0 + 0.001 * k)[0]
        own = np.ones(depth.shape, bool)
        seen.append(Observation(depth, own, np.ones(depth.shape, np.float32), CAMERA, np.eye(4)))
    clouds = [own_points(o, 2) for o in seen]
    whole = allocated([np.concatenate(clouds)], 0.01, 0.03)
    pieces = allocated(clouds, 0.01, 0.03)
    np.testing.assert_array_equal(pieces.blocks, whole.blocks)
    for one in seen:
        integrate(whole, [one], 0.03, 0.5, GOOD_SENSOR.curve)
    integrate(pieces, iter(seen), 0.03, 0.5, GOOD_SENSOR.curve)
    assert whole.weight.any()
    np.testing.assert_array_equal(pieces.distance, whole.distance)
    np.testing.assert_array_equal(pieces.weight, whole.weight)


@pytest.mark.parametrize("count", [1, 2, 3, 100, 101])
@pytest.mark.parametrize("spread", [0.0001, 0.02, 2.0])
def test_the_median_of_counted_depths_is_that_of_all(count: int, spread: float) -> None:
    depths = (1.0 + spread * np.random.default_rng(count).random(count)).astype(np.float32)
    counts = np.bincount(_bin(depths), minlength=5000)
    found = _median(counts, lambda low, high: depths[(_bin(depths) == low) | (_bin(depths) == high)])
    assert found == float(np.median(depths))


def test_cleaning_keeps_shape() -> None:
    cube = box((0, 0, 0), (1, 1, 1))
    assert reduce_faces(cube.vertices, cube.faces, 100)[1] is cube.faces
    grid = np.array([[x, y, 0.0] for x in range(21) for y in range(21)])
    quads = np.array(
        [[x * 21 + y, x * 21 + y + 1, x * 21 + y + 22] for x in range(20) for y in range(20)], np.int32
    )
    noisy = grid + np.random.default_rng(0).normal(0, 0.05, grid.shape)
    assert np.abs(smooth(noisy, quads, 5)[:, 2]).mean() < 0.7 * np.abs(noisy[:, 2]).mean()
