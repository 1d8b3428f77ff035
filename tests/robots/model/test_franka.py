"""The bundled Franka against an independent computation of the published tables (Pinocchio)."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.catalog import names, resolve
from robots.model.kinematics import read_chain
from robots.model.spec import load_spec
from twin import geometry as geo
from twin.errors import InputError

pin = pytest.importorskip("pinocchio")

# a, d, alpha (Craig) of the manufacturer's interface documentation
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -np.pi / 2),
    (0.0, 0.316, np.pi / 2),
    (0.0825, 0.0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (0.088, 0.0, np.pi / 2),
]


def dh_model() -> pin.Model:
    model = pin.Model()
    parent = 0
    for i, (a, d, alpha) in enumerate(DH):
        turn = pin.SE3(pin.utils.rotate("x", alpha), np.zeros(3))
        placement = turn * pin.SE3(np.eye(3), np.array([a, 0.0, d]))
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{i + 1}")
    tool = pin.SE3(pin.utils.rotate("z", -np.pi / 4), np.array([0.0, 0.0, 0.107 + 0.1034]))
    model.addFrame(pin.Frame("tool", parent, 0, tool, pin.FrameType.OP_FRAME))
    return model


@pytest.fixture(scope="module")
def franka():
    spec = resolve("franka")
    model = mujoco.MjModel.from_xml_path(str(spec.model))
    return spec, model, read_chain(model, spec)


def samples(chain, n=40):
    rng = np.random.default_rng(3)
    return rng.uniform(chain.lower, chain.upper, (n, 7))


def test_forward_kinematics_is_the_published_table(franka):
    spec, model, chain = franka
    reference = dh_model()
    rdata, data = reference.createData(), mujoco.MjData(model)
    q = samples(chain)
    poses, _ = chain.forward(q)
    for k in range(len(q)):
        pin.framesForwardKinematics(reference, rdata, q[k])
        expected = rdata.oMf[reference.getFrameId("tool")].homogeneous
        data.qpos[:7] = q[k]
        mujoco.mj_kinematics(model, data)
        assert np.abs(data.site(spec.tool).xpos - expected[:3, 3]).max() < 1e-12
        assert np.abs(data.site(spec.tool).xmat.reshape(3, 3) - expected[:3, :3]).max() < 1e-12
        assert np.abs(poses[k] - expected).max() < 1e-12


def test_jacobian_is_pinocchios(franka):
    _, _, chain = franka
    reference = dh_model()
    rdata = reference.createData()
    q = samples(chain, 10)
    _, jacobians = chain.forward(q)
    for k in range(len(q)):
        expected = pin.computeFrameJacobian(
            reference, rdata, q[k], reference.getFrameId("tool"), pin.ReferenceFrame.LOCAL
        )
        assert np.abs(jacobians[k] - expected).max() < 1e-12


def test_gravity_torque_is_pinocchios_from_the_same_masses(franka):
    _, model, chain = franka
    data = mujoco.MjData(model)
    reference = pin.buildModelFromMJCF(str(resolve("franka").model))
    rdata = reference.createData()
    for q in samples(chain, 10):
        full = np.concatenate([q, [0.02, 0.02]])
        data.qpos[:], data.qvel[:] = full, 0.0
        mujoco.mj_forward(model, data)
        expected = pin.computeGeneralizedGravity(reference, rdata, full)
        assert np.abs(data.qfrc_gravcomp[:7] - expected[:7]).max() < 1e-6
        assert np.abs(expected[:7]).max() > 1.0


def test_limits_are_the_published_ones(franka):
    spec, model, chain = franka
    assert np.allclose(chain.upper, [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
    assert np.allclose(chain.lower, [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
    assert np.allclose(spec.effort, [87, 87, 87, 87, 12, 12, 12])
    assert np.allclose(model.jnt_actfrcrange[:7, 1], spec.effort)
    assert np.allclose(model.actuator_forcerange[:7, 1], spec.effort)
    assert spec.force <= 70
    assert model.actuator_forcerange[7, 1] == spec.force


def test_inertias_are_physical(franka):
    _, model, _ = franka
    assert np.isclose(
        model.body_mass.sum(), 16.6919 + 0.76, atol=1e-3
    )  # Gaz et al. 2019, plus hand and fingers
    for moments in model.body_inertia[1:]:
        assert moments.min() > 0
        assert 2 * moments.max() <= moments.sum() * (1 + 1e-9)


def test_the_arm_holds_its_pose_and_the_gripper_closes_with_its_force(franka):
    spec, model, _ = franka
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:7], data.ctrl[7] = spec.home, spec.stroke
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos[:7] - spec.home).max() < 1e-6
    assert np.isclose(data.qpos[7:].sum(), spec.stroke, atol=1e-3)
    data.ctrl[7] = -0.02
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos[7:]).max() < 1.5e-3  # its stops hold the full force
    assert abs(data.actuator_force[7]) == pytest.approx(spec.force)


def test_example_robot_data_panda_agrees(franka):
    try:
        wheel = distribution("example-robot-data")
    except PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    urdf = next(f for f in wheel.files or [] if f.name == "panda.urdf")
    panda = pin.buildModelFromUrdf(str(wheel.locate_file(urdf)))
    data, hand = panda.createData(), panda.getFrameId("panda_hand")
    _, _, chain = franka
    for q in samples(chain, 10):
        full = pin.neutral(panda)
        full[:7] = q
        pin.framesForwardKinematics(panda, data, full)
        tool = data.oMf[hand].homogeneous @ geo.make_pose(translation=[0, 0, 0.1034])
        assert np.abs(chain.forward(q[None])[0][0] - tool).max() < 1e-6
    names = [f"panda_joint{k}" for k in range(1, 8)]
    at = [panda.joints[panda.getJointId(n)].idx_q for n in names]
    assert np.allclose(panda.lowerPositionLimit[at], chain.lower)
    assert np.allclose(panda.upperPositionLimit[at], chain.upper)


def test_unknown_robot_lists_what_exists():
    assert "franka" in names()
    with pytest.raises(InputError, match="known robots: franka"):
        resolve("frnka")


def test_robot_file_without_a_gripper_says_so(tmp_path: Path):
    text = resolve("franka").model.with_suffix(".toml").read_text(encoding="utf-8")
    (tmp_path / "franka.xml").write_bytes(resolve("franka").model.read_bytes())
    bare = tmp_path / "bare.toml"
    bare.write_text(text.split("[gripper]")[0], encoding="utf-8")
    with pytest.raises(InputError, match=r"no \[gripper\] section"):
        load_spec(bare)


def test_robot_file_that_names_a_missing_joint_says_which(tmp_path: Path):
    source = resolve("franka").model
    (tmp_path / "franka.xml").write_bytes(source.read_bytes())
    file = tmp_path / "mine.toml"
    text = source.with_suffix(".toml").read_text(encoding="utf-8")
    file.write_text(text.replace('"joint7"]', '"joint8"]'), encoding="utf-8")
    spec = load_spec(file)
    with pytest.raises(InputError, match="joint8"):
        read_chain(mujoco.MjModel.from_xml_path(str(spec.model)), spec)


def test_batched_inverse_kinematics_reaches_reachable_poses(franka):
    _, _, chain = franka
    q = samples(chain, 60)
    target, _ = chain.forward(q)
    start = q + np.random.default_rng(0).normal(0, 0.2, q.shape)
    found, error = chain.solve(np.clip(start, chain.lower, chain.upper), target, np.ones(6), 60)
    assert np.mean(np.linalg.norm(error[:, :3], axis=1) < 2e-3) > 0.9
    assert np.all(found >= chain.lower)
    assert np.all(found <= chain.upper)
