"""Tasks other than opening fully, contacts other than the hand's, and the torques that a plan asks for."""

from __future__ import annotations

import logging
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig, ReplayConfig
from robots.grasp.by_shape import holds_by_shape
from robots.grasp.holds import find_holds
from robots.grasp.tool_path import make_grasps
from robots.grasp.where_to_hold import elsewhere
from robots.model.catalog import resolve
from robots.model.dynamics import ArmDynamics, Terms, part_load
from robots.planning.joint_path import may_move_alone, moves_alone
from robots.scene.world import build_world
from robots.simulation.replay import simulate
from robots.task import Task, task_of
from twin import geometry as geo
from twin.contacts import distance_to
from twin.errors import InputError, PlanningError
from twin.quantities import Inertial, Quantity
from twin.scene import ContactPath, Twin

pin = pytest.importorskip("pinocchio")
FAST = PlanConfig(candidates=150, finalists=2)


@pytest.fixture(scope="module")
def franka():
    return resolve("franka")


def heavy(twin: Twin, mass: float) -> Twin:
    """The same twin with a part of this mass (kg), spread like a board."""
    part = twin.parts[0]
    size = np.ptp(part.mesh.vertices, axis=0)
    inertia = np.diag(mass / 12 * (np.sum(size**2) - size**2))
    weighed = Inertial(
        Quantity(mass, "user: test", (mass, mass)), part.mesh.area_centroid, inertia, "user: test"
    )
    return replace(twin, parts=(replace(part, inertial=weighed),))


def without_contact(twin: Twin) -> Twin:
    return replace(twin, parts=(replace(twin.parts[0], contact=None),))


# --- tasks


def test_a_goal_is_a_share_unless_it_has_a_unit():
    """A number and its text mean the same, on the command line and in Python."""
    part = furniture.drawer(travel=0.4).parts[0]
    assert task_of(part) == Task(0.0, 0.4)
    assert task_of(part, "close") == task_of(part, "0m") == task_of(part, 0.0) == Task(0.4, 0.0)
    halves = ("50%", "0.5", 0.5, "0.2m", "20 cm", "200mm")
    assert {round(task_of(part, half).goal, 9) for half in halves} == {0.2}
    assert task_of(part, "25%", from_state="0.3m") == Task(0.3, 0.1)
    for wrong in ("150%", "-0.1", "ajar", "nan", "inf", "", 1.5, float("nan"), "15deg", "0.2 rad"):
        with pytest.raises(InputError, match=r"no share of its range and no state; .* in m or cm or mm"):
            task_of(part, wrong)
    with pytest.raises(InputError, match=r"'0.5m' of part .* choose a state from 0.000m to 0.400m"):
        task_of(part, "0.5m")


def test_the_states_of_a_hinge_are_angles():
    part = furniture.door(angle=np.pi / 2).parts[0]
    tasks = [task_of(part, goal) for goal in ("15deg", "15 deg", f"{np.pi / 12}rad", 1 / 6)]
    assert [t.goal for t in tasks] == pytest.approx([np.deg2rad(15)] * 4)
    with pytest.raises(InputError, match=r"no state; .* in rad or deg, such as 45.0deg"):
        task_of(part, "0.2m")
    with pytest.raises(InputError, match=r"choose a state from 0.0deg to 90.0deg"):
        task_of(part, "95deg")


@pytest.mark.parametrize(("start", "goal"), [(0.0, 0.4), (0.4, 0.0), (0.1, 0.3), (0.3, 0.1)])
def test_the_share_reached_is_0_at_the_start_1_at_the_goal_and_falls_beyond_it(start, goal):
    task = Task(start, goal)
    assert task.direction == np.sign(goal - start)
    assert task.reached(start) == pytest.approx(0.0)
    assert task.reached(goal) == pytest.approx(1.0)
    assert task.reached(0.5 * (start + goal)) == pytest.approx(0.5)
    assert task.reached(goal + 0.25 * (goal - start)) == pytest.approx(0.75)


@pytest.mark.parametrize("make", [furniture.drawer, furniture.door, furniture.lid])
def test_what_opens_also_closes(make):
    twin = make()
    part = twin.parts[0]
    trajectory = robots.plan(twin, part.id, goal="close", config=FAST)
    assert trajectory.part_state[0] == pytest.approx(part.joint.upper)
    assert trajectory.part_state[-1] == pytest.approx(0.0)
    report = robots.replay(twin, trajectory, video=False)
    assert report.ok, report.reason
    assert report.opening_final <= 0.10
    assert report.reached >= 0.90
    assert report.phases[0].phase == ("close" if moves_alone(part, part.joint.upper) else "approach")


def test_a_part_left_open_is_not_closed():
    """The report measures the way to the goal: a hand that never grips closes nothing."""
    twin = furniture.drawer()
    trajectory = robots.plan(twin, 2, goal="close", config=replace(FAST, rehearse=False))
    idle = replace(trajectory, gripper=np.full(len(trajectory.times), 0.08), q=np.tile(trajectory.q[0], (len(trajectory.q), 1)), qd=np.zeros_like(trajectory.qd))  # fmt: skip
    report = robots.replay(twin, idle, video=False)
    assert report.opening_final > 0.9
    assert report.reached < 0.1
    assert not report.success_75
    assert not report.ok


def test_only_the_side_without_a_stop_moves_alone():
    part = furniture.lid().parts[0]
    assert moves_alone(part, part.joint.upper)
    assert moves_alone(part, 0.5 * part.joint.upper)
    assert not moves_alone(part, 0.0)
    upside = replace(part, joint=replace(part.joint, axis=-part.joint.axis))  # its weight opens it
    assert moves_alone(upside, 0.0)
    assert not moves_alone(upside, part.joint.upper)


def test_a_part_that_might_move_by_itself_is_not_let_go():
    """A vertical hinge holds the door; one that may lean by two sigma of 5 degrees would not."""
    part = furniture.door().parts[0]
    sure, unsure = (
        replace(part, joint=replace(part.joint, covariance=np.diag([tilt**2, tilt**2, 1e-6, 1e-6])))
        for tilt in np.deg2rad([0.05, 5.0])
    )
    assert not may_move_alone(part, 1.0)
    assert not may_move_alone(sure, 1.0)
    assert may_move_alone(unsure, 1.0)
    twin = furniture.door()
    kept = robots.plan(replace(twin, parts=(unsure,)), 2, config=replace(FAST, rehearse=False))
    assert kept.phases[-1] == "hold"
    let_go = replace(FAST, rehearse=False, release=True)
    assert robots.plan(replace(twin, parts=(unsure,)), 2, config=let_go).phases[-1] == "retreat"


def test_a_part_that_is_in_the_hand_from_the_start_is_gripped_before_it_can_fall():
    twin = furniture.lid()
    trajectory = robots.plan(twin, 2, goal="close", config=replace(FAST, rehearse=False))
    assert trajectory.phases[0] == "close"
    world = build_world(twin, robots.resolve("franka"), trajectory.T_world_base, trajectory.pedestal)
    seen = []
    record, _ = simulate(
        world, trajectory, ReplayConfig(), lambda d: seen.append(float(d.qpos[world.part_qpos[2]]))
    )
    closing = trajectory.times[[p == "close" for p in trajectory.phases]][-1]
    count = int(closing / world.model.opt.timestep)
    assert np.ptp(seen[1:count]) < 2e-3  # a free lid would fall by a tenth of a radian
    assert record.touching[np.flatnonzero(record.phase == 1)[-1]] == 2


def test_what_is_fed_forward_is_what_the_servos_need_not_find(franka):
    """With the efforts of the plan a stiff arm follows its plan better than without, lid and all."""
    twin = heavy(furniture.lid(), 5.0)
    trajectory = robots.plan(twin, 2, config=replace(FAST, rehearse=False))
    without = replace(trajectory, effort=np.zeros_like(trajectory.effort))
    mean = [robots.replay(twin, t, video=False).tracking_mean_mm for t in (trajectory, without)]
    assert mean[0] < 0.6 * mean[1]
    still = np.array([p in ("open", "retreat") for p in trajectory.phases])
    assert not trajectory.effort[still][:1].any()


# --- contacts


def test_a_contact_off_the_part_is_refused_with_its_distance():
    twin = furniture.drawer()
    with pytest.raises(InputError, match=r"is 0\.9\d m off part 'part'"):
        robots.plan(twin, 2, contact=[0.0, -1.0, 0.6])
    with pytest.raises(InputError, match="three finite numbers"):
        robots.plan(twin, 2, contact=[0.0, np.nan, 0.6])


def test_a_users_point_decides_which_handle_is_held(franka):
    twin = furniture.drawer()
    part = twin.parts[0]
    second, grip = furniture.bar([0.18, 0.021, 0.6], 0.08, vertical=True)
    both = furniture.twin_of([*part.collision, *second], part.joint, twin.static.collision, part.contact)
    own = robots.plan(both, 2, config=replace(FAST, rehearse=False))
    told = robots.plan(both, 2, contact=grip, config=replace(FAST, rehearse=False))
    held = [t.T_world_tool[[p == "close" for p in t.phases].index(True), :3, 3] for t in (own, told)]
    assert np.linalg.norm(held[1] - grip) < 0.05
    assert np.linalg.norm(held[0] - grip) > 0.10


def test_distance_to_a_surface_is_exact():
    mesh = furniture.mesh_of([furniture.box([0, 0, 0], [1, 1, 1])])
    assert distance_to(mesh, np.array([0.9, 0.1, 0.0])) == pytest.approx(0.4)
    assert distance_to(mesh, np.array([0.5 + 0.3, 0.5 + 0.4, 0.0])) == pytest.approx(0.5)


SHAPES = {
    "drawer": (furniture.drawer, "bar"),
    "knob": (lambda: furniture.drawer(handle="knob"), "knob"),
    "left door": (furniture.door, "bar"),
    "right door": (lambda: furniture.door("right"), "bar"),
    "slider": (furniture.sliding_door, "bar"),
    "lid": (furniture.lid, "edge"),
    "noisy door": (lambda: furniture.noisy(furniture.door("right")), "bar"),
}


@pytest.mark.parametrize("case", SHAPES)
def test_the_shape_alone_says_where_to_hold(case, franka):
    make, kind = SHAPES[case]
    twin = make()
    part = twin.parts[0]
    assert part.contact is not None
    hold = holds_by_shape(without_contact(twin), part, franka, 0)[0]
    assert hold.kind == kind
    assert np.linalg.norm(hold.centre - part.contact.point) < 0.04
    assert np.degrees(geo.line_angle(hold.rotation[:, 1], part.contact.rotation[:, 1])) < 10 or kind == "knob"
    if kind != "edge":
        assert hold.rotation[:, 2] @ part.contact.rotation[:, 2] > 0.95, "the hand comes from outside"


def test_a_twin_without_contact_is_opened_by_its_shape():
    twin = without_contact(furniture.door())
    report = robots.replay(twin, robots.plan(twin, 2, config=FAST), video=False)
    assert report.ok, report.reason


def test_a_contact_far_off_gives_way_to_the_shape(caplog):
    twin = furniture.drawer()
    c = twin.parts[0].contact
    lost = ContactPath(c.point + [0, -0.5, 0], c.rotation, c.width, c.frames, c.source)
    astray = replace(twin, parts=(replace(twin.parts[0], contact=lost),))
    with caplog.at_level(logging.WARNING):
        trajectory = robots.plan(astray, 2, config=replace(FAST, rehearse=False))
    assert "off the part" in caplog.text
    assert trajectory.grasp.startswith("bar")


def test_nothing_to_hold_is_one_line():
    block = furniture.box([0, 0, 1], [0.4, 0.4, 0.4])
    twin = furniture.twin_of([block], furniture.drawer().parts[0].joint, [furniture.floor()], None)
    with pytest.raises(InputError, match="no bar, knob or rim") as caught:
        robots.plan(twin, 2)
    assert "\n" not in str(caught.value)


def test_a_lag_costs_more_about_a_thick_handle(franka):
    """Fingers that turn by an angle about a handle roll off its middle by half its thickness times the
    angle."""
    part = furniture.door().parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]

    def price(thickness, way):
        grasps = make_grasps(replace(hold, thickness=thickness), part.joint, franka, way=way)
        still, most = (min(g.cost for g in grasps if g.turn == t) for t in (0.0, 0.5))
        return most - still

    assert price(0.040, 1.4) > price(0.010, 1.4) + 0.5
    assert price(0.040, 1.4) - price(0.040, 0.7) == pytest.approx(0.020 * 0.5 * 0.7 / 0.010)


# --- torques


@pytest.mark.parametrize("seed", range(20))
def test_the_shortest_time_is_where_the_torque_meets_its_limit(seed):
    rng = np.random.default_rng(seed)
    terms = Terms(rng.uniform(-4, 4, (6, 3)), rng.normal(0, 3, (6, 3)), rng.normal(0, 5, (6, 3)))
    limit = np.array([5.0, 6.0, 7.0])

    def share(t):
        return (np.abs(terms.still + terms.viscous / t + terms.inertial / t**2) / limit).max()

    shortest = terms.shortest(limit)
    assert share(shortest) == pytest.approx(1.0, abs=1e-9)
    for slower in np.geomspace(1.0001, 100, 50):
        assert share(shortest * slower) < 1.0
    assert Terms(terms.still * 3 + 9, terms.viscous, terms.inertial).shortest(limit) == np.inf
    assert Terms(terms.still, 0 * terms.viscous, 0 * terms.inertial).shortest(limit) == 0.0


@pytest.mark.parametrize("name", ["franka", "spot"])
def test_inverse_dynamics_are_pinocchios(name):
    spec = resolve(name)
    model = mujoco.MjModel.from_xml_path(str(spec.model))
    arm, n = ArmDynamics(spec, model), len(spec.arm_joints)
    reference = pin.buildModelFromMJCF(str(spec.model))
    data, rng = reference.createData(), np.random.default_rng(0)
    added = model.dof_armature[:n], model.dof_damping[:n]
    # pin.rnea adds the reflected inertia that its model holds; here it is added by hand, and only once.
    reference.armature = np.zeros(reference.nv)
    fingers = np.zeros(reference.nv - n)
    for _ in range(10):
        q, qd, qdd = spec.home + rng.normal(0, 0.4, n), rng.normal(0, 1, n), rng.normal(0, 5, n)
        full = [np.concatenate([v, fingers]) for v in (q, qd, qdd)]
        expected = pin.rnea(reference, data, *full)[:n] + added[0] * qdd + added[1] * qd
        assert np.abs(arm.torque(q[None], qd[None], qdd[None])[0] - expected).max() < 1e-6


def rnea_torques(trajectory, twin, spec):
    """Pinocchio's torques (n, 7) of the move, with the part's resistance as a force on the tool."""
    reference = pin.buildModelFromMJCF(str(spec.model))
    data = reference.createData()
    frame = reference.getFrameId(spec.tool)
    part, moving = twin.parts[0], np.array([p == "move" for p in trajectory.phases])
    t, q, qd = trajectory.times[moving], trajectory.q[moving], trajectory.qd[moving]
    state, load = trajectory.part_state[moving], part_load(part)
    qdd = np.gradient(qd, t, axis=0)
    rate = np.gradient(state, t)
    force = load.inertia * np.gradient(rate, t) + load.damping * rate
    force += load.still(state, np.sign(trajectory.goal - trajectory.start))
    tool = geo.transform(geo.invert_pose(trajectory.T_world_base), trajectory.T_world_tool[moving][:, :3, 3])
    way = np.gradient(tool, t, axis=0)
    torques = []
    for k in range(5, len(t) - 5):  # at rest the way has no direction
        full = np.concatenate([q[k], [0, 0]])
        speed, gain = np.concatenate([qd[k], [0, 0]]), np.concatenate([qdd[k], [0, 0]])
        tau = pin.rnea(reference, data, full, speed, gain)[:7]
        jacobian = pin.computeFrameJacobian(
            reference, data, full, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        along = way[k] / (way[k] @ way[k]) * rate[k]
        torques.append(tau + jacobian[:3, :7].T @ (along * force[k]))
    return np.array(torques)


def test_a_heavy_drawer_is_moved_more_slowly_and_within_the_torque_limits(franka):
    light, loaded = heavy(furniture.drawer(), 3.0), heavy(furniture.drawer(), 150.0)
    config = PlanConfig(candidates=150, finalists=2, rehearse=False, torque_share=0.6, tool_speed=1.5)
    plans = [robots.plan(t, 2, config=config) for t in (light, loaded)]
    seconds = [np.ptp(p.times[[x == "move" for x in p.phases]]) for p in plans]
    assert seconds[1] > 1.3 * seconds[0]
    share = np.abs(rnea_torques(plans[1], loaded, franka)) / franka.effort
    assert share.max() <= 0.6 * 1.03
    assert share.max() >= 0.6 * 0.85, "slower than the torque asks for"


def test_an_arm_that_is_too_weak_says_which_joint_and_by_how_much():
    with pytest.raises(PlanningError, match=r"joint\d is too weak at state .* N m at rest.*N m may be used"):
        robots.plan(heavy(furniture.lid(), 60.0), 2, config=replace(FAST, rehearse=False))


# --- other places on a handle


def test_other_places_are_on_the_same_bar_and_a_knob_has_none(franka):
    part = furniture.door().parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]
    others = elsewhere(part, [hold], franka, 0)
    assert len(others) >= 2
    along = hold.rotation[:, 1]
    for other in others:
        assert other.kind == "bar"
        shift = other.centre - hold.centre
        assert 0.03 < abs(shift @ along) < 0.10  # the bar is 20 cm long
        assert np.linalg.norm(shift - (shift @ along) * along) < 0.003
    places = np.sort([(h.centre - hold.centre) @ along for h in (hold, *others)])
    assert np.diff(places).min() > 0.03, "no place is tried twice"
    knob = furniture.drawer(handle="knob").parts[0]
    assert elsewhere(knob, find_holds(knob.mesh, knob.contact, franka), franka, 0) == []


def test_where_the_hand_held_is_blocked_the_robot_takes_the_bar_elsewhere(franka):
    """A block in front of the middle of a long bar, where the person's hand was."""
    twin = furniture.door()
    at = twin.parts[0].contact.point
    block = furniture.box(at + [0.0, -0.06, 0.03], [0.30, 0.03, 0.12])
    blocked = replace(twin, static=replace(twin.static, collision=(*twin.static.collision, block)))
    plan = robots.plan(blocked, 2, config=replace(FAST, rehearse=False))
    held = plan.T_world_tool[plan.phases.index("close"), :3, 3]
    assert held[2] < at[2] - 0.03
    free = robots.plan(twin, 2, config=replace(FAST, rehearse=False))
    assert abs(free.T_world_tool[free.phases.index("close"), 2, 3] - at[2]) < 0.02
