"""Trials on parts that differ from the twin: laws of the draws and of the statistics, and the nominal replay
as a limit."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.stats import binomtest, kstest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig, ReplayConfig
from robots.model.catalog import resolve
from robots.reasons import REASONS, RefusedError, reason, reason_of
from robots.scene.world import build_world
from robots.simulation.replay import simulate
from robots.simulation.report import measure
from robots.trajectory import PHASES
from robots.trials.batch import GROUP, replay_all
from robots.trials.perturbation import (
    CONTACT_SIGMA,
    ErrorSizes,
    closes_itself,
    draw,
    path_error,
    perturbed,
    spread_of,
)
from robots.trials.report import LADDER, Trial, TrialRow
from robots.trials.run_trials import run_trials
from robots.trials.statistics import mean, wilson
from tests.makers.robots.drawn import nominal
from twin import geometry as geo
from twin.cli.main import run
from twin.errors import ConfigError, InputError
from twin.scene import Inertial, JointSigma, Motion, PartPhysics, Quantity
from twin.storage import save

_FAST = PlanConfig(candidates=150, finalists=1)
_FULL = ErrorSizes(np.deg2rad(5), 0.02, 0.01)


@pytest.fixture(scope="module")
def drawer():
    twin = furniture.drawer()
    return twin, robots.plan(twin, "part", config=_FAST)


@pytest.fixture(scope="module")
def hinged():
    """A door with a covariance and physics of its own."""
    part = furniture.door("left").parts[0]
    root = np.random.default_rng(5).normal(size=(4, 4)) * [[0.02], [0.01], [0.004], [0.007]]
    q = lambda value, low, high: Quantity(value, "user: a test", (low, high))  # noqa: E731
    physics = PartPhysics(q(0.6, 0.3, 0.9), q(0.5, 0.1, 2.0), q(1.0, 0.0, 4.0), q(700, 500, 800))
    inertial = Inertial(q(5.0, 3.0, 6.0), part.mesh.area_centroid, np.diag([0.2, 0.25, 0.1]))
    return replace(
        part, joint=replace(part.joint, covariance=root @ root.T), physics=physics, inertial=inertial
    )


@pytest.mark.parametrize(("k", "n"), [(0, 1), (1, 1), (0, 30), (29, 30), (50, 100), (100, 100), (3, 1000)])
def test_wilson_interval_is_scipys(k, n):
    expected = binomtest(k, n).proportion_ci(0.95, method="wilson")
    found = wilson(k, n)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert found.low <= found.value == k / n <= found.high


def test_students_interval_covers_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(0)
    estimates = [mean(rng.normal(size=5).tolist()) for _ in range(2000)]
    covered = sum(e.low <= 0 <= e.high for e in estimates)
    assert binomtest(covered, 2000, 0.95).pvalue > 0.01


def test_draws_have_the_covariance_asked_for(hinged):
    spread = spread_of(hinged)
    draws = [draw(hinged, spread, None, 3, k) for k in range(4000)]
    basis = geo.orthogonal_basis(hinged.joint.axis)
    tilt = np.array([np.cross(hinged.joint.axis, d.joint.axis) @ basis[:, :2] for d in draws])
    shift = np.array([(d.joint.pivot - hinged.joint.pivot) @ basis for d in draws])
    assert np.abs(shift[:, 2]).max() < 1e-12  # along the axis nothing moves
    found = np.concatenate([tilt, shift[:, :2]], axis=1)
    white = found @ np.linalg.inv(np.linalg.cholesky(hinged.joint.covariance)).T
    assert np.cov(white.T) == pytest.approx(np.eye(4), abs=0.08)
    assert np.abs(white.mean(axis=0)).max() < 0.06
    contact = np.array([d.contact for d in draws]) / CONTACT_SIGMA
    assert np.cov(contact.T) == pytest.approx(np.eye(3), abs=0.08)
    for key in ("mass", "friction", "damping", "frictionloss"):
        low, high = getattr(spread, key)
        values = (np.array([getattr(d, key) for d in draws]) - low) / (high - low)
        assert kstest(values, "uniform").pvalue > 0.01, key


def test_stated_sizes_are_met_exactly_and_directions_are_shared_by_all_rows(hinged):
    spread = spread_of(hinged)
    for k in range(50):
        full, half = draw(hinged, spread, _FULL, 0, k), draw(hinged, spread, ErrorSizes(contact=0.005), 0, k)
        assert geo.angle_between(full.joint.axis, hinged.joint.axis) == pytest.approx(np.deg2rad(5))
        assert np.linalg.norm(full.joint.pivot - hinged.joint.pivot) == pytest.approx(0.02)
        assert np.linalg.norm(full.contact) == pytest.approx(0.01)
        assert half.joint is hinged.joint
        assert half.contact == pytest.approx(full.contact / 2)
        assert (half.mass, half.frictionloss) == (full.mass, full.frictionloss)


def test_path_error_of_a_shift_is_the_shift_and_of_a_tilted_slide_its_chord(drawer):
    part, point = drawer[0].parts[0], np.array([0.1, -0.2, 0.5])
    sure = nominal(part)
    assert path_error(part, sure, point, 0.35) == 0
    assert path_error(
        part, replace(sure, contact=np.array([0.0, 0.006, 0.008])), point, 0.35
    ) == pytest.approx(0.01)
    tilted = replace(sure, joint=part.joint.plus([0.03, 0.04, 0, 0]))
    assert path_error(part, tilted, point, 0.35) == pytest.approx(2 * 0.35 * np.sin(0.025))


def test_no_error_is_the_nominal_replay_exactly(drawer):
    twin, trajectory = drawer
    world = build_world(twin, robots.resolve("franka"), trajectory.T_world_base, trajectory.pedestal)
    config = ReplayConfig()
    part = twin.parts[0]
    alone = robots.replay(twin, trajectory, config=config).to_json()
    shifted = replace(nominal(part), contact=np.array([0, 0, 0.004]))
    draws = [nominal(part), nominal(part), shifted]
    told: list[tuple[int, int]] = []
    here = replay_all(world, trajectory, part, draws, config, tell=lambda *count: told.append(count))
    assert told == [(3, 3)], "too few for processes"
    assert [r.to_json() == alone for r in here] == [True, True, False]
    there = replay_all(
        world, trajectory, part, draws, config, workers=2, group=1, tell=lambda *count: told.append(count)
    )
    assert told[1:] == [(1, 3), (2, 3), (3, 3)]
    assert [r.to_json() for r in there] == [r.to_json() for r in here]


@pytest.mark.parametrize("along", [0.0, 0.6, -3.0])
def test_a_perturbed_scene_is_the_scene_of_the_perturbed_part(hinged, along):
    """Changing the compiled scene equals compiling the changed part, wherever on its axis (m) the twin has
    the pivot."""
    joint = hinged.joint
    hinged = replace(hinged, joint=joint.with_pivot(joint.pivot + along * joint.axis))
    twin = replace(furniture.door("left"), parts=(hinged,))
    drawn = draw(hinged, spread_of(hinged), _FULL, 1, 4)
    real = replace(
        hinged,
        joint=drawn.joint,
        inertial=replace(
            hinged.inertial.with_mass(Quantity(drawn.mass, "user: drawn", (drawn.mass, drawn.mass))),
            com=hinged.inertial.com + drawn.contact,
        ),
        physics=replace(
            hinged.physics,
            damping=Quantity(drawn.damping, "user: drawn", (0, 9)),
            frictionloss=Quantity(drawn.frictionloss, "user: drawn", (0, 9)),
            friction=Quantity(drawn.friction, "user: drawn", (0, 9)),
        ),
        collision=tuple(
            replace(b, T_world_box=geo.make_pose(translation=drawn.contact) @ b.T_world_box)
            for b in hinged.collision
        ),
    )
    spec, base = robots.resolve("franka"), geo.make_pose(translation=[0, -0.8, 0.4])
    changed = perturbed(build_world(twin, spec, base, 0.4), hinged, drawn)
    compiled = build_world(replace(twin, parts=(real,)), spec, base, 0.4)
    models = changed.model, compiled.model
    moves = models[0].body_weldid > 0  # the weight of what is fixed to the world counts for nothing
    for name in (
        "jnt_axis", "body_mass", "body_inertia", "dof_damping", "dof_frictionloss", "dof_armature", "dof_invweight0",
        "body_invweight0", "bvh_aabb",
    ):  # fmt: skip
        ours, theirs = (getattr(m, name)[moves if name.startswith("body") else ...] for m in models)
        assert ours == pytest.approx(theirs, abs=1e-9), name
    # frames of bodies are on the twin's hinge in the one and on the drawn one in the other: what they mean is
    # compared
    both = [mujoco.MjData(m) for m in models]
    for state in np.linspace(0.0, drawn.joint.upper, 4):
        for m, d in zip(models, both, strict=True):
            d.qpos[changed.part_qpos[hinged.id]] = state
            mujoco.mj_forward(m, d)
        for name in ("xaxis", "xipos", "geom_xpos", "geom_xmat", "qfrc_bias", "M"):
            assert getattr(both[0], name) == pytest.approx(getattr(both[1], name), abs=1e-9), name


def test_same_seed_same_bytes_whatever_the_workers(drawer, tmp_path):
    twin, trajectory = drawer
    trials = 3  # of 4 rows: draws for both processes
    assert trials * (1 + len(LADDER)) > GROUP
    for name, workers, seed in (("a", 1, 7), ("b", 2, 7), ("c", 2, 8)):
        run_trials(twin, trajectory, tmp_path / name, trials=trials, seed=seed, workers=workers)
    texts = {n: (tmp_path / n / "trials.json").read_bytes() for n in "abc"}
    pictures = {n: (tmp_path / n / "trials.png").read_bytes() for n in "ab"}
    assert texts["a"] == texts["b"]
    assert json.loads(texts["a"])["rows"] != json.loads(texts["c"])["rows"]
    assert pictures["a"] == pictures["b"]
    written = json.loads(texts["a"])
    assert [len(row["trials"]) for row in written["rows"]] == [trials] * (1 + len(LADDER))
    assert all(0 <= row["success_90"]["low"] <= row["success_90"]["high"] <= 1 for row in written["rows"])
    first = written["rows"][0]["trials"][0]
    assert set(first) >= {"axis", "contact_shift", "mass", "friction", "damping", "frictionloss", "reason"}


def test_a_report_tells_how_the_arm_was_driven(drawer):
    twin, trajectory = drawer
    stiff = ReplayConfig(control="position", stiffness=0.5)
    told = [run_trials(twin, trajectory, trials=1, config=c).to_json() for c in (None, stiff)]
    assert [(t["control"], t["stiffness"]) for t in told] == [("impedance", 1.0), ("position", 0.5)]
    assert told[0]["rows"] != told[1]["rows"]


def test_what_the_twin_does_not_state_is_said(hinged):
    bare = furniture.door("left").parts[0]
    said = "\n".join(spread_of(bare).missing)
    for what in ("covariance", "contact"):
        assert what in said
    assert "used the default in every direction (axis 1°, pivot 5 mm)" in said
    assert len(spread_of(hinged).missing) == 1  # the contact alone
    sigma = replace(bare, joint=replace(bare.joint, sigma=JointSigma(np.deg2rad(2), 0.003, 0.01)))
    assert "used its sigma in every direction (axis 2°, pivot 3 mm)" in "\n".join(spread_of(sigma).missing)
    assert spread_of(sigma).joint == pytest.approx(np.diag([np.deg2rad(2) ** 2] * 2 + [9e-6] * 2))


def test_a_part_that_falls_shut_after_the_release_is_told_from_one_that_the_hand_pushed(drawer):
    """What the judge of replays really says, not a text that it once wrote: the part is driven shut after the
    release."""
    twin, trajectory = drawer
    part = twin.parts[0]
    world = build_world(twin, resolve("franka"), trajectory.T_world_base, trajectory.pedestal)
    record, _ = simulate(world, trajectory, ReplayConfig())
    after = np.flatnonzero(record.phase == PHASES.index("retreat"))
    state = record.state.copy()
    state[after[0] :] = np.linspace(state[after[0]], 0.1, len(state) - after[0])
    report = measure(replace(record, state=state), trajectory, part, world.spec, 0.0, None)
    assert report.faults[0].type == "CameBack"
    sure = nominal(part)
    fell = Trial(sure, 0.0, True, report).reason
    assert fell.type == "ClosedByItself"
    assert (fell.numbers["peak"], fell.numbers["final"]) == (report.opening_peak, report.opening_final)
    assert Trial(sure, 0.0, False, report).reason == report.faults[0]
    lost = replace(report, faults=(reason("LostPart", 0.2), *report.faults))
    assert Trial(sure, 0.0, True, lost).reason == reason("LostPart", 0.2)


def test_reasons_are_counted_by_their_kind(drawer):
    twin, trajectory = drawer
    good = robots.replay(twin, trajectory, video=False)
    assert good.reason == ""
    faults = [
        reason("CameBack", "opened", 0.97, 0.3),
        reason("CameBack", "opened", 0.93, 0.1),
        reason("Slipped", 0.02),
    ]
    failed = [replace(good, success_90=False, faults=(f,)) for f in faults]
    row = TrialRow(None, tuple(Trial(nominal(twin.parts[0]), 0.0, False, r) for r in [good, *failed]))
    assert row.reasons == {"the part opened and came back": 2, "the grip slipped": 1}


def test_every_reason_tells_its_numbers_in_the_text_alone():
    samples = [
        reason("NoRoom"), reason("Unreachable", 0.31, "m", 0.12, 0.4, "joint4 at its upper limit"), reason("Reconfigures", 1.3), reason("Reconfigures", None),
        reason("InCollision", "hand and door", 0.2, 0.013), reason("TooWeak", "joint4", 0.2, True, 61.5, 52.2, 58.0), reason("NotGripped", 1.0),
        reason("AtTorqueLimit", "joint4", 87.0, "N m", 3.14), reason("BeyondJointLimit", 0.004), reason("LostPart", 0.2), reason("CameBack", "opened", 0.97, 0.3),
        reason("ClosedByItself", 0.97, 0.3), reason("Stuck", "opened", 0.53, ("link5", "door")), reason("Stuck", "closed", 0.5, None),
        reason("IntoScene", "link5", 0.0031, 3.5), reason("Slipped", 0.02), reason("StillMoving"), reason("Unlawful", "joint1 leaves its limits by 0.1"),
    ]  # fmt: skip
    assert {s.type for s in samples} == set(REASONS)
    for s in samples:
        assert not re.search(r"(?<![\w.])\d", s.kind), s.kind
        assert s.text
    assert reason_of(RefusedError(samples[0])) is samples[0]


def test_a_part_that_gains_height_closes_itself_unless_friction_holds_it(drawer):
    part = drawer[0].parts[0]
    sure = replace(nominal(part), mass=4.0, frictionloss=3.0)
    raised = {}
    for angle in (-0.1, 0.05, 0.1):  # 4 kg * 9.81 m/s^2 * sin(angle) is 2.0 N and 3.9 N
        axis = geo.exp_so3([-angle, 0, 0]) @ part.joint.axis
        raised[angle] = closes_itself(part, replace(sure, joint=replace(part.joint, axis=axis)), 0.3)
    assert raised == {-0.1: False, 0.05: False, 0.1: True}


def test_wrong_requests_are_refused_in_one_line(drawer, tmp_path, capsys):
    twin, trajectory = drawer
    with pytest.raises(InputError, match="0 trials were asked for"):
        run_trials(twin, trajectory, trials=0)
    with pytest.raises(ConfigError, match="not negative"):
        ErrorSizes(axis=-0.1)
    with pytest.raises(ConfigError, match="stiffness"):
        ReplayConfig(stiffness=0.0)
    save(replace(twin, parts=(replace(twin.parts[0], motion=Motion([], [], [])),)), tmp_path / "twin")
    for options in (["--trials", "0"], ["--trials", "2", "--seed", "-1"], ["--grid"]):
        assert run(["replay", str(tmp_path), *options]) == 1
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "replay").exists()
