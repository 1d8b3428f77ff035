"""The random cabinets that replays are measured on are what they say: movable, held at their surface, in
nobody's way."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import trimesh

from benchmarks.scenes.random_furniture import HANDLES, KINDS, random_furniture
from robots.model.catalog import resolve
from robots.scene.world import PART, STATIC, build_world
from twin import geometry as geo


@pytest.mark.parametrize("handle", HANDLES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_cabinet_opens_freely_and_is_held_at_its_surface(kind, handle):
    twin = random_furniture(kind, handle, 3)
    part = twin.parts[0]
    mesh = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces, process=False)
    assert trimesh.proximity.closest_point(mesh, part.contact.point[None])[1][0] < 0.02
    assert part.inertial.mass.value > 0.5
    outward = part.joint.velocity(0.3 * part.joint.upper, part.contact.point)
    assert np.linalg.norm(outward) > 0.2, "the hand's way is short"
    far = geo.make_pose(translation=[0, 0, 30.0])
    world = build_world(twin, resolve("franka"), far, 0.0)
    model, data = world.model, mujoco.MjData(world.model)
    moving, fixed = np.flatnonzero(world.owner == PART), np.flatnonzero(world.owner == STATIC)
    for state in np.linspace(0.0, part.joint.upper, 5):
        data.qpos[world.part_qpos[part.id]] = state
        mujoco.mj_forward(model, data)
        near = min(mujoco.mj_geomDistance(model, data, g, f, 0.01, None) for g in moving for f in fixed)
        assert near > -2e-3, f"{-1000 * near:.1f} mm into the cabinet at {state:.2f}"


def test_equal_seeds_give_equal_cabinets_and_others_do_not():
    a, b, c = (random_furniture("lid", "bar", seed) for seed in (1, 1, 2))
    assert np.array_equal(a.parts[0].mesh.vertices, b.parts[0].mesh.vertices)
    assert a.parts[0].joint.upper != c.parts[0].joint.upper
