"""The grasp sits on the handle, however far off the hand's contact was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes import furniture
from benchmarks.scenes.random_furniture import random_furniture
from robots.grasp import tool_path
from robots.grasp.holds import find_holds
from robots.grasp.tool_path import backed_off, make_grasps
from robots.grasp.where_to_hold import holds_of
from robots.model.catalog import resolve
from tests.makers.twin import scans
from twin import geometry as geo
from twin.completion.infer import infer
from twin.scene import ContactPath, HandleSection, Mesh


@pytest.fixture(scope="module")
def franka():
    return resolve("franka")


def hold_of(twin, franka):
    part = twin.parts[0]
    return find_holds(part.mesh, part.contact, franka)[0]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", [furniture.drawer, furniture.door, furniture.sliding_door])
def test_a_bar_is_found_though_the_contact_is_3_cm_off(make, seed, franka):
    exact, off = make(), make(error=0.03, seed=seed)
    hold, true = hold_of(off, franka), exact.parts[0].contact
    assert hold.kind == "bar"
    across = geo.nearest_point_on_line(hold.centre, true.point, true.rotation[:, 1]) - hold.centre
    assert np.linalg.norm(across) < 0.002
    assert abs((hold.centre - true.point) @ true.rotation[:, 1]) < 0.06
    assert np.degrees(geo.line_angle(hold.rotation[:, 1], true.rotation[:, 1])) < 2
    assert np.degrees(geo.angle_between(hold.rotation[:, 2], true.rotation[:, 2])) < 2
    assert hold.thickness == pytest.approx(0.02 if make is furniture.sliding_door else 0.014, abs=0.002)


@pytest.mark.parametrize("make", [furniture.drawer, furniture.door, furniture.sliding_door])
def test_a_bar_is_found_on_a_noisy_mesh(make, franka):
    true = make().parts[0].contact
    hold = hold_of(furniture.noisy(make(error=0.02, seed=3), seed=5), franka)
    assert hold.kind == "bar"
    across = geo.nearest_point_on_line(hold.centre, true.point, true.rotation[:, 1]) - hold.centre
    assert np.linalg.norm(across) < 0.010
    assert np.degrees(geo.line_angle(hold.rotation[:, 1], true.rotation[:, 1])) < 8


def test_the_bar_decides_its_direction_not_the_hand(franka):
    twin = furniture.door()
    c = twin.parts[0].contact
    twisted = ContactPath(
        c.point, geo.exp_so3(c.rotation[:, 2] * 0.8) @ c.rotation, c.width, c.frames, c.source
    )
    hold = find_holds(twin.parts[0].mesh, twisted, franka)[0]
    assert np.degrees(geo.line_angle(hold.rotation[:, 1], [0, 0, 1])) < 2


def test_a_knob_can_be_closed_on_both_ways(franka):
    part = furniture.drawer(handle="knob", error=0.02).parts[0]
    holds = find_holds(part.mesh, part.contact, franka)
    assert [h.kind for h in holds] == ["knob", "knob"]
    assert abs(holds[0].rotation[:, 0] @ holds[1].rotation[:, 0]) < 1e-9
    assert all(h.thickness == pytest.approx(0.03, abs=0.002) for h in holds)
    assert np.allclose(holds[0].centre, [0, -0.012, 0.6], atol=0.003)


def test_a_board_without_handle_is_held_by_its_edge(franka):
    part = furniture.lid(error=0.02).parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]
    assert hold.kind == "edge"
    assert hold.thickness == pytest.approx(0.018, abs=0.003)
    assert abs(hold.centre[2] - 0.512) < 0.003
    assert hold.centre[1] > -0.06  # inside the board, whose rim is at -0.06


def test_nothing_near_leaves_the_contact_itself(franka):
    part = furniture.drawer().parts[0]
    far = Mesh(part.mesh.vertices + [5.0, 0, 0], part.mesh.faces)
    holds = find_holds(far, part.contact, franka)
    assert [h.kind for h in holds] == ["contact"]
    assert np.array_equal(holds[0].centre, part.contact.point)


def test_what_is_thicker_than_the_gripper_opens_is_no_hold(franka):
    boxes = [furniture.box([0, 0, 1], [0.6, 0.02, 0.6]), furniture.box([0, -0.06, 1], [0.2, 0.1, 0.2])]
    contact = furniture.contact_at([0, -0.11, 1], [0, 0, 1], [0, -1, 0], 0.1)
    assert all(
        h.thickness < franka.stroke or not h.refined
        for h in find_holds(furniture.mesh_of(boxes), contact, franka)
    )


def test_the_tool_goes_deeper_than_the_handle_but_keeps_off_the_panel(franka, monkeypatch):
    for make in (furniture.drawer, furniture.door):
        part = make().parts[0]
        hold = find_holds(part.mesh, part.contact, franka)[0]
        for deeper in (0.0, 0.02, 0.1):
            monkeypatch.setattr(tool_path, "OVER_INSERT", deeper)
            grasps = [g for g in make_grasps(hold, part.joint, franka) if "lean 0 deg" in g.label]
            assert grasps
            for g in grasps:
                depth = (g.T_world_tool[:3, 3] - hold.centre) @ g.T_world_tool[:3, 2]
                assert depth <= deeper + 1e-9
                assert depth + franka.tip <= hold.stand_off - 0.003
                assert depth + hold.depth <= franka.palm + 1e-9


def test_the_hand_comes_from_outside_and_closes_across_the_bar(franka):
    part = furniture.door().parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]
    grasps = make_grasps(hold, part.joint, franka)
    for g in grasps:
        assert np.allclose(g.T_world_tool[:3, :3].T @ g.T_world_tool[:3, :3], np.eye(3), atol=1e-9)
        assert np.linalg.det(g.T_world_tool[:3, :3]) > 0
        assert g.T_world_tool[:3, 2] @ hold.rotation[:, 2] < -0.8
        assert abs(g.T_world_tool[:3, 1] @ hold.rotation[:, 0]) > 0.999
    assert len({np.sign(g.T_world_tool[:3, 1] @ hold.rotation[:, 0]) for g in grasps}) == 2
    moved = backed_off(grasps[0].T_world_tool, 0.1)[:3, 3] - grasps[0].T_world_tool[:3, 3]
    assert moved @ hold.rotation[:, 2] > 0.08


def test_the_tool_is_rigid_in_the_part_or_lags_by_its_share(franka):
    part = furniture.door().parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]
    states = np.linspace(0, part.joint.upper, 5)
    for g in make_grasps(hold, part.joint, franka):
        in_part = geo.invert_pose(part.joint.poses(states)) @ g.path(part.joint, states)
        turned = geo.rotation_angle(in_part[:, :3, :3] @ g.T_world_tool[:3, :3].T)
        assert np.allclose(turned, g.turn * states, atol=1e-6)
        centre = geo.transform(in_part @ geo.invert_pose(g.T_world_tool), hold.centre[None])[:, 0]
        assert np.allclose(centre, hold.centre, atol=1e-9)


def test_a_drawers_front_seen_from_above_is_a_rim_not_a_handle(franka):
    """It stands out 18 cm from the drawer's floor: a wall, to be held at its upper end."""
    part = random_furniture("drawer_high", "edge", 5).parts[0]
    hold = find_holds(part.mesh, part.contact, franka)[0]
    top = part.mesh.vertices[:, 2].max()
    assert hold.kind == "edge"
    assert np.ptp(part.mesh.vertices[:, 2]) > 0.15
    assert top - 0.03 < hold.centre[2] < top
    assert hold.thickness == pytest.approx(0.018, abs=0.002)
    assert abs(hold.rotation[:, 0] @ [0, 1, 0]) > 0.99


def test_a_knob_pivots_about_the_closing_direction_when_that_is_the_hinges(franka):
    part = random_furniture("flap_up", "knob", 0).parts[0]
    holds = find_holds(part.mesh, part.contact, franka)
    sideways = next(h for h in holds if abs(h.rotation[:, 0] @ part.joint.axis) > 0.9)
    states = np.array([0.0, part.joint.upper])
    turned, angles = set(), {}
    for g in make_grasps(sideways, part.joint, franka):
        turned.add(g.turn)
        first, last = g.path(part.joint, states)
        angles.setdefault(g.turn, geo.angle_between(first[:3, 2], last[:3, 2]))
        # the pads turn on the knob: the closing direction stays along the hinge, the knob between them
        assert abs(last[:3, 1] @ part.joint.axis) > 0.9
        lean = np.arccos(-first[:3, 2] @ sideways.rotation[:, 2])
        out = part.joint.poses(states[1:])[0, :3, :3] @ sideways.rotation[:, 2]
        assert max(lean, np.arccos(-last[:3, 2] @ out)) < 0.81
    assert turned == {0.0, 0.25, 0.5, 0.75}
    assert angles[0.75] < angles[0.0]


def test_only_rims_are_taken_far_aslant(franka):
    rim, door = furniture.lid().parts[0], furniture.door().parts[0]
    leans = {}
    for part in (rim, door):
        hold = find_holds(part.mesh, part.contact, franka)[0]
        grasps = make_grasps(hold, part.joint, franka)
        tilt = [np.arccos(-g.T_world_tool[:3, 2] @ hold.rotation[:, 2]) for g in grasps]
        leans[hold.kind] = max(tilt)
    assert leans["edge"] == pytest.approx(0.8, abs=1e-6)
    assert leans["bar"] == pytest.approx(0.45, abs=1e-6)


def test_a_completed_part_is_held_where_it_is_solid(franka):
    """A scan blurs the bar of 12 mm to 24; what is closed on is the bar that the asset has, as thick as
    photographs told."""
    held = scans.part_of(scans.drawer().mesh, scans.drawer().joint, np.array([0.0, -0.044, 0.686]))
    section = HandleSection(np.array([0.0, -0.050, 0.686]), 0.012, 5)
    whole = infer(scans.twin_of(replace(held, handle=section)))
    part = whole.parts[0]
    seen = replace(part, completion=None)
    ours, blurred = (holds_of(whole, p, franka, None, 0)[0] for p in (part, seen))
    bar = next(p for p in part.completion.pieces if p.name == "handle").mesh
    assert ours.kind == blurred.kind == "bar"
    assert abs(ours.thickness - np.ptp(bar.vertices, axis=0)[2]) < 0.002
    assert abs(ours.thickness - 0.012) < 0.002
    assert blurred.thickness > ours.thickness + 0.005
    np.testing.assert_allclose(ours.centre[1:], bar.vertices.mean(axis=0)[1:], atol=0.004)
