"""The simulator's truth is exact: what it writes agrees with what it renders and with the joint's own
laws."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from recon.simulate import SimulateConfig, simulate
from recon.simulate.config import Staging
from recon.simulate.hand import PHALANGES, hand_shape, skeleton
from recon.simulate.joints import load_model
from recon.simulate.kitchen import kitchen_scene
from recon.simulate.mjcf import articulations
from recon.simulate.painters import SIZE
from recon.simulate.ray_caster import Caster
from recon.simulate.record import new_recording
from recon.simulate.sensors.depth_camera import DepthCamera
from recon.simulate.sensors.frame import Frame
from recon.simulate.simulator import opening
from recon.simulate.stage import Stage
from recon.simulate.textures import PAINTERS, make_material, mipmaps
from recon.simulate.timeline import Timeline, minimum_jerk
from tests.makers.recon.paint import plain_surfaces
from twin.errors import ConfigError, InputError, MissingDependencyError
from twin.geometry import Array, invert_pose, matrix_from_quat_wxyz, rotation_angle, transform

ROOT = Path(__file__).parents[3]
SCENES = ROOT / "assets" / "scenes"
SMALL = Staging(width=160, height=120, frames=24, samples=1, ambient_samples=1, seed=3, depth_noise=0.0)
CASES = [
    ("base_cabinet.xml", "drawer_top", "prismatic"),
    ("base_cabinet.xml", "door_left_hinged", "revolute"),
    ("chest.xml", "lid", "revolute"),
    ("sliding_sideboard.xml", "slide_left", "prismatic"),
]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny recording of a door without depth noise."""
    out = tmp_path_factory.mktemp("simulated") / "door"
    with plain_surfaces():
        return simulate(SCENES / "base_cabinet.xml", "door_left_hinged", out, SMALL)


@cache
def stage_of(scene: str, joint: str) -> Stage:
    """A stage at full length; only looked at, so tests may share it."""
    with plain_surfaces(8):
        return opening(SCENES / scene, joint, replace(SMALL, frames=None))


def read_truth(folder: Path) -> dict[str, object]:
    return json.loads((folder / "truth" / "truth.json").read_text())


def camera_poses(folder: Path) -> tuple[Array, Array]:
    rows = np.loadtxt(folder / "truth" / "trajectory.txt")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = matrix_from_quat_wxyz(rows[:, [7, 4, 5, 6]])
    poses[:, :3, 3] = rows[:, 1:4]
    return rows[:, 0], poses


def image(folder: Path, kind: str, index: int) -> NDArray[np.uint16]:
    suffix = "jpg" if kind == "color" else "png"
    return cv2.imread(str(folder / kind / f"{index:06d}.{suffix}"), cv2.IMREAD_UNCHANGED)


def test_the_layout_is_the_native_one(recording: Path) -> None:
    intrinsic = json.loads((recording / "intrinsic.json").read_text())
    fx, _, _, _, fy, _, cx, cy, one = intrinsic["intrinsic_matrix"]  # column-major
    assert (intrinsic["width"], intrinsic["height"], one) == (160, 120, 1)
    assert fx == fy == pytest.approx(80.0 / np.tan(np.radians(74.6 / 2)))
    assert (cx, cy) == (79.5, 59.5)
    for kind in ("color", "depth", "truth/labels"):
        assert len(list((recording / kind).iterdir())) == SMALL.frames
    times = np.loadtxt(recording / "timestamps.txt")
    np.testing.assert_allclose(np.diff(times), 1 / 15, atol=2e-6)
    np.testing.assert_allclose(camera_poses(recording)[0], times)
    assert image(recording, "color", 0).shape == (120, 160, 3)
    assert image(recording, "depth", 0).dtype == np.uint16


def test_the_furniture_is_what_stands_still_of_the_tree_that_carries_the_part(recording: Path) -> None:
    truth = recording / "truth"
    own, still = (trimesh.load(truth / f"{n}.ply", process=False) for n in ("furniture_2", "static"))

    def triangles(mesh: trimesh.Trimesh) -> set[bytes]:
        return {t.tobytes() for t in np.sort(np.round(mesh.triangles, 6), axis=1) + 0.0}

    assert triangles(own) < triangles(still), "the room stands still, too"
    np.testing.assert_allclose(own.bounds, [[-0.795, -0.068, 0.0], [0.795, 0.56, 0.878]], atol=1e-6)
    door = trimesh.load(truth / "part_2.ply", process=False)
    assert not triangles(door) & triangles(own)


def test_true_meshes_at_true_poses_give_the_depth_and_the_labels(recording: Path) -> None:
    truth = recording / "truth"
    part, still = trimesh.load(truth / "part_2.ply"), trimesh.load(truth / "static.ply")
    poses, (_, cameras) = np.load(truth / "part_poses.npz")["part_2"], camera_poses(recording)
    matrix = json.loads((recording / "intrinsic.json").read_text())["intrinsic_matrix"]
    v, u = np.mgrid[0:120, 0:160]
    for i in (0, 13, 23):
        local = np.stack(
            [(u - matrix[6]) / matrix[0], (v - matrix[7]) / matrix[4], np.ones(u.shape)], axis=-1
        )
        rays = np.concatenate(
            [np.broadcast_to(cameras[i, :3, 3], local.shape), local @ cameras[i, :3, :3].T], axis=-1
        )
        caster = Caster()
        caster.add(np.asarray(still.vertices), np.asarray(still.faces))
        caster.add(transform(poses[i], part.vertices), np.asarray(part.faces))
        hits = caster.first(rays.reshape(-1, 6))
        labels = image(recording, "truth/labels", i).reshape(-1)
        depth = image(recording, "depth", i).reshape(-1) / 1000.0
        seen = labels != 255
        # meshes are stored as float32 and trajectories with nine digits: rays on an edge may fall to either
        # side
        assert np.mean(np.abs(depth - hits.t)[seen] > 0.0006) < 0.002
        assert np.mean((labels == 2)[seen] != (hits.mesh == 1)[seen]) < 0.002
        assert (labels == 2).sum() > 200
        hand = labels == 255
        assert np.all(depth[hand] <= hits.t[hand] + 0.001)


def test_part_poses_are_the_joints_motion(recording: Path) -> None:
    part = read_truth(recording)["parts"][0]
    poses = np.load(recording / "truth" / "part_poses.npz")["part_2"]
    axis, pivot, states = (
        np.array(part["axis_world"]),
        np.array(part["pivot_world"]),
        np.array(part["states"]),
    )
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(rotation_angle(poses[:, :3, :3]), states, atol=1e-9)
    for pose in poses:
        np.testing.assert_allclose(transform(pose, pivot[None])[0], pivot, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3] @ axis, axis, atol=1e-12)
    first, last = part["interval"]
    assert states[first] == 0.0 < states[first + 1]
    assert states[last - 1] < states[last] == states[-1]
    assert states[-1] == pytest.approx(0.8 * part["range"][1])


@pytest.mark.parametrize(("scene", "joint", "kind"), CASES)
def test_geometry_mass_and_motion_agree_with_mujoco(scene: str, joint: str, kind: str) -> None:
    loaded = load_model(SCENES / scene)
    (articulation,) = articulations(loaded, scene, (joint,), (), 1.0, np.random.default_rng(0))
    model = mujoco.MjModel.from_xml_path(str(SCENES / scene))
    data = mujoco.MjData(model)
    index = model.joint(joint).id
    body = int(model.jnt_bodyid[index])
    state = 0.4 * articulation.span
    before = {g: _geom_pose(model, data, g, index, 0.0) for g in np.flatnonzero(model.geom_bodyid == body)}
    for geom, rest in before.items():
        moved = _geom_pose(model, data, int(geom), index, state)
        np.testing.assert_allclose(articulation.pose(state) @ rest, moved, atol=1e-12)
    assert articulation.kind == kind
    assert articulation.mass == pytest.approx(float(model.body_subtreemass[body]))
    np.testing.assert_allclose(
        articulation.com, _reset(model, data, index, 0.0).subtree_com[body], atol=1e-12
    )
    xx, yy, zz, xy, xz, yz = articulation.inertia
    principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert principal[0] > 0.0
    assert principal[2] <= principal[0] + principal[1] + 1e-12
    vertices = np.concatenate([s.vertices for s in articulation.part])
    size = np.ptp(vertices, axis=0).max()
    assert principal[2] < articulation.mass * size**2


def _reset(model: mujoco.MjModel, data: mujoco.MjData, joint: int, state: float) -> mujoco.MjData:
    data.qpos[model.jnt_qposadr[joint]] = state
    mujoco.mj_forward(model, data)
    return data


def _geom_pose(model: mujoco.MjModel, data: mujoco.MjData, geom: int, joint: int, state: float) -> Array:
    _reset(model, data, joint, state)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    return pose


@pytest.mark.parametrize(("scene", "joint", "kind"), CASES)
def test_the_grip_is_on_the_bar(scene: str, joint: str, kind: str) -> None:
    stage = stage_of(scene, joint)
    bar = next(
        s
        for s in stage.parts[0].part
        if s.name == f"{joint.replace('_hinged', '')}_handle" or "handle" in s.name
    )
    centre = 0.5 * (bar.vertices.min(axis=0) + bar.vertices.max(axis=0))
    along = stage.acts[0].grasp.bar
    offset = stage.acts[0].grasp.point - centre
    assert stage.acts[0].grasp.source == "handle"
    assert np.linalg.norm(offset - (offset @ along) * along) < 0.002
    assert abs(offset @ along) < 0.5 * np.ptp(bar.vertices @ along)
    assert np.ptp(bar.vertices @ along) == pytest.approx(np.ptp(bar.vertices, axis=0).max(), rel=0.01)
    assert stage.acts[0].grasp.width == pytest.approx(0.012, abs=0.001)


@pytest.mark.parametrize(("scene", "joint", "kind"), CASES)
def test_the_camera_moves_like_a_head_and_sees_the_part(scene: str, joint: str, kind: str) -> None:
    stage = stage_of(scene, joint)
    steps = np.linalg.norm(np.diff(stage.cameras[:, :3, 3], axis=0), axis=1)
    turns = rotation_angle(invert_pose(stage.cameras[:-1])[:, :3, :3] @ stage.cameras[1:, :3, :3])
    assert 0.001 < steps.mean() < 0.02
    assert steps.max() < 0.04
    assert np.degrees(turns).max() < 3.0
    for i in (stage.acts[0].line.start, stage.acts[0].line.end):
        point = transform(
            stage.parts[0].pose(float(stage.acts[0].states[i])), stage.acts[0].grasp.point[None]
        )
        local = transform(invert_pose(stage.cameras[i]), point)
        pixel = stage.camera.project(local)[0]
        assert 0.0 < pixel[0] < 160.0
        assert 0.0 < pixel[1] < 120.0
        assert 0.5 < local[0, 2] < 2.0


def test_the_hand_holds_the_part_and_turns_less_than_the_door(recording: Path) -> None:
    truth = read_truth(recording)
    arrays = np.load(recording / "truth" / "hand_keypoints.npz")
    part, hand = truth["parts"][0], truth["hand"]
    states = np.array(part["states"])
    held = np.flatnonzero(hand["contact"])
    poses = np.load(recording / "truth" / "part_poses.npz")["part_2"]
    grip = np.array(part["grip"]["point_world"])
    for i in held:
        expected = transform(poses[i], grip[None])[0]
        np.testing.assert_allclose(hand["contact_point_world"][i], expected, atol=1e-12)
        np.testing.assert_allclose(arrays["T_world_hand"][i, :3, 3], expected, atol=1e-12)
        assert hand["contact_part"][i] == 2
        tips = arrays["keypoints_world"][i][[8, 12, 16, 20]]
        assert np.linalg.norm(tips - expected, axis=1).max() < 0.06
    turned = rotation_angle(
        arrays["T_world_hand"][held[-1], :3, :3] @ arrays["T_world_hand"][held[0], :3, :3].T
    )
    assert turned == pytest.approx(0.5 * states[-1])
    line = Timeline.of(SMALL)
    for i in range(line.frames):
        share = np.mean(image(recording, "truth/labels", i) == 255)
        if i < line.enter or i >= line.gone:
            assert share == 0.0
    assert np.mean(image(recording, "truth/labels", line.grasp) == 255) > 0.01


def test_equal_seeds_give_equal_frames_and_others_do_not() -> None:
    config = replace(SMALL, width=64, height=48)
    first, again = (opening(SCENES / "chest.xml", "lid", config).render(12) for _ in range(2))
    np.testing.assert_array_equal(first.colour, again.colour)
    np.testing.assert_array_equal(first.labels, again.labels)
    with plain_surfaces():
        mine, other = (
            opening(SCENES / "chest.xml", "lid", replace(config, seed=s)).render(12) for s in (3, 4)
        )
    assert not np.array_equal(mine.depth, other.depth)


def test_depth_noise_grows_with_distance_and_leaves_most_pixels() -> None:
    with plain_surfaces():
        stage = opening(SCENES / "base_cabinet.xml", "drawer_middle", SMALL)
    view, rays = stage.render(0), stage.view_directions(0)
    frame = Frame(view, rays, np.zeros((120, 160, 3), np.uint8), 0, np.random.default_rng(0))
    exact, depth = (
        DepthCamera("structured_light", stage.camera, scale, 0).image(frame).astype(float)
        for scale in (0.0, 1.0)
    )
    np.testing.assert_array_equal(exact, np.round(1000.0 * view.depth.astype(float)))
    assert np.all(exact > 0)
    known = depth > 0
    assert 0.85 < known.mean() < 1.0
    error = np.abs(depth - exact)
    near, far = known & (exact < 1400), known & (exact > 2000)
    assert 0.5 < np.median(error[near]) < np.median(error[far]) < 20.0


def test_any_size_and_a_joint_of_the_kitchen() -> None:
    try:
        scene = kitchen_scene()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    with plain_surfaces():
        stage = opening(scene, "microwave", replace(SMALL, width=96, height=54))
    assert stage.parts[0].kind == "revolute"
    np.testing.assert_allclose(stage.parts[0].axis, [0.0, 0.0, -1.0], atol=1e-9)
    assert not any("panda" in s.name for s in stage.still)
    view = stage.render(stage.acts[0].line.start)
    assert view.depth.shape == (54, 96)
    assert np.mean(view.labels == 2) > 0.01


def test_a_missing_kitchen_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recon.simulate.kitchen.find_spec", lambda _: None)
    with pytest.raises(
        MissingDependencyError, match=r"install the package gymnasium-robotics.*extra `simulate`"
    ):
        kitchen_scene()


def test_bad_input_is_named(tmp_path: Path) -> None:
    cabinet = SCENES / "base_cabinet.xml"
    with pytest.raises(
        InputError, match=r"no hinge or slide joint 'drawer_to'.*drawer_top.*door_left_hinged"
    ):
        simulate(cabinet, "drawer_to", tmp_path / "a", SMALL)
    with pytest.raises(InputError, match="no scene file"):
        simulate(tmp_path / "none.xml", "lid", tmp_path / "a", SMALL)
    (tmp_path / "bad.xml").write_text("<mujoco><worldbody><geom/></worldbody>")
    with pytest.raises(InputError, match="can't load the scene") as caught:
        simulate(tmp_path / "bad.xml", "lid", tmp_path / "a", SMALL)
    assert "\n" not in str(caught.value)
    with plain_surfaces(8), pytest.raises(InputError, match="no site or geom 'knob'"):
        simulate(cabinet, "drawer_top", tmp_path / "a", replace(SMALL, handle="knob"))
    with pytest.raises(ConfigError, match=r"opening = 0\.9 m is beyond"):
        simulate(cabinet, "drawer_top", tmp_path / "a", replace(SMALL, opening=0.9))
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("")
    with plain_surfaces(8), pytest.raises(InputError, match="not an empty folder"):
        simulate(cabinet, "drawer_top", tmp_path / "full", SMALL)
    with pytest.raises(ConfigError, match=r"width = 4000 must be from 32 to 1920 px"):
        SimulateConfig(width=4000)
    assert not (tmp_path / "a").exists()


def test_minimum_jerk_rests_at_both_ends() -> None:
    t = np.linspace(0.0, 1.0, 1001)
    s = minimum_jerk(t)
    np.testing.assert_allclose([s[0], s[500], s[-1]], [0.0, 0.5, 1.0])
    assert np.all(np.diff(s) >= 0.0)
    assert max(abs(np.gradient(s, t)[[0, -1]])) < 1e-4


@pytest.mark.parametrize("closure", [0.0, 0.5, 1.0])
def test_the_hand_is_one_closed_surface_with_human_phalanges(closure: float) -> None:
    material = make_material("skin", 1.0, np.random.default_rng(0))
    shape = hand_shape(closure, material, spacing=0.004)
    mesh = trimesh.Trimesh(shape.surface.vertices, shape.surface.faces, process=False)
    assert mesh.is_watertight
    assert len(mesh.split(only_watertight=False)) == 1
    assert 2e-4 < abs(mesh.volume) < 6e-4  # cubic metres; an adult hand has about 0.35 litres
    points = skeleton(closure)
    for k, lengths in enumerate(PHALANGES.values()):
        measured = np.linalg.norm(np.diff(points[5 + 4 * k : 9 + 4 * k], axis=0), axis=1)
        np.testing.assert_allclose(measured, lengths, atol=1e-12)


@pytest.mark.parametrize("kind", sorted(PAINTERS))
def test_textures_tile_and_have_detail(kind: str) -> None:
    picture = make_material(kind, 1.0, np.random.default_rng(2)).image
    assert picture.shape == (SIZE, SIZE, 3)
    assert picture.min() > 0.0
    assert picture.max() < 1.0
    assert float(picture.std()) > 0.01
    levels = mipmaps(picture)
    assert [level.shape[0] for level in levels[:3]] == [SIZE, SIZE // 2, SIZE // 4]
    means = [level.mean(axis=(0, 1), dtype=np.float64) for level in (levels[-1], picture)]
    np.testing.assert_allclose(means[0], means[1], atol=1e-5)


def interrupted_after(path: Path) -> None:
    path.write_bytes(b"a frame")
    raise KeyboardInterrupt


def test_a_recording_that_was_interrupted_can_be_simulated_again(tmp_path):
    """Its first frames stood in the folder, and the same command refused to write into it."""
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt), new_recording(out) as staged:
        interrupted_after(staged / "color/000000.jpg")
    assert not list(tmp_path.iterdir())
    out.mkdir()
    with new_recording(out) as staged:
        (staged / "color/000000.jpg").write_bytes(b"a frame")
    assert (out / "color/000000.jpg").read_bytes() == b"a frame"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    with pytest.raises(InputError, match="is not an empty folder"), new_recording(out):
        pass
