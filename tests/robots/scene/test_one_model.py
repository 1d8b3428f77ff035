"""What a replay simulates is what was exported: the scene without the robot equals the file, number by
number."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from benchmarks.scenes.boards import cabinet_twin
from robots.replay_verb import replay_step
from robots.scene.world import PEDESTAL, PREFIX, build_world, completed
from robots.task import MotionRequest
from robots.trials.perturbation import perturbed
from tests.makers.robots.drawn import nominal
from twin import geometry as geo
from twin.errors import InputError, PlanningError
from twin.exporters import export
from twin.runs.progress import silent
from twin.scene import Twin
from twin.storage import save

TWINS = {
    "drawer": furniture.drawer,
    "nested": lambda: furniture.laden_door(5.0),
    "meshes": lambda: cabinet_twin(lid=True),
}
BASE = geo.make_pose(geo.exp_so3([0, 0, 0.3]), [0.1, -0.9, 0.4])
# Where a row begins and which number another thing has: these count the robot's things, too.
COUNTED = ("adr", "num", "id", "ids", "sameframe", "subtreemass", "bvh", "simple", "tree")
# The scene's own: who meets whom, and what the film leaves out.
OWN = {"geom_contype", "geom_conaffinity", "geom_group", "body_contype", "body_conaffinity"}
MADE = ("body", "jnt", "dof", "geom", "site")


@pytest.fixture(params=TWINS)
def twin(request):
    return completed(TWINS[request.param]())


@pytest.fixture
def exported(twin, tmp_path):
    return mujoco.MjModel.from_xml_path(str(export(twin, tmp_path, formats=("mjcf",))["mjcf"]))


def table(model: mujoco.MjModel, kind: str) -> dict[str, dict[str, np.ndarray]]:
    """Name -> field -> numbers of all bodies, joints, degrees of freedom, geoms or sites that are not the
    robot's."""
    count = {
        "body": model.nbody,
        "jnt": model.njnt,
        "dof": model.nv,
        "geom": model.ngeom,
        "site": model.nsite,
    }[kind]
    fields = [
        f for f in dir(model)
        if f.startswith(f"{kind}_") and f not in OWN and not f.endswith(COUNTED) and len(getattr(model, f)) == count
    ]  # fmt: skip
    bodies = range(count) if kind == "body" else getattr(model, f"{kind}_bodyid")
    own = [k for k, b in enumerate(bodies) if not model.body(b).name.startswith((PREFIX, PEDESTAL))]
    return {named(model, kind, k): {f: np.array(getattr(model, f)[k]) for f in fields} for k in own}


def named(model: mujoco.MjModel, kind: str, k: int) -> str:
    """Name of a thing; a degree of freedom has its joint's."""
    if kind == "dof":
        return model.joint(model.dof_jntid[k]).name
    return getattr(model, {"jnt": "joint"}.get(kind, kind))(k).name


def options(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    return {f: np.array(getattr(model.opt, f)) for f in dir(model.opt) if not f.startswith("_")}


def links(model: mujoco.MjModel) -> tuple[dict[str, str], dict[str, str], set[frozenset[str]]]:
    """Parent of each body, body of each geom, and the pairs of bodies that never touch, of what is not the
    robot's."""
    own = [b for b in range(model.nbody) if not model.body(b).name.startswith((PREFIX, PEDESTAL))]
    parents = {model.body(b).name: model.body(model.body_parentid[b]).name for b in own}
    geoms = {
        model.geom(g).name: model.body(model.geom_bodyid[g]).name
        for g in range(model.ngeom) if model.geom_bodyid[g] in own
    }  # fmt: skip
    pairs = [(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature]
    return parents, geoms, {frozenset(model.body(b).name for b in p) for p in pairs if set(p) <= set(own)}


def corners(model: mujoco.MjModel, geom: str) -> np.ndarray:
    """Vertices of a geom's mesh, none for other shapes."""
    mesh = int(model.geom(geom).dataid[0])
    if mesh < 0:
        return np.zeros((0, 3))
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    return model.mesh_vert[start : start + count]


def check_rows(model: mujoco.MjModel, kind: str, wanted: dict[str, dict[str, np.ndarray]]) -> None:
    mine = table(model, kind)
    for name, row in wanted.items():
        for field, value in row.items():
            assert mine[name][field] == pytest.approx(value, rel=1e-12, abs=1e-15), f"{name} {field}"


def check_equal(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    """Every number of the exported model stands in the scene."""
    assert options(ours).keys() == options(theirs).keys()
    for name, value in options(theirs).items():
        assert np.array_equal(options(ours)[name], value), name
    assert links(ours) == links(theirs)
    for kind in MADE:
        wanted = table(theirs, kind)
        assert table(ours, kind).keys() == wanted.keys()
        check_rows(ours, kind, wanted)
    for name in table(theirs, "geom"):
        assert np.array_equal(corners(ours, name), corners(theirs, name)), name


@pytest.mark.parametrize("robot", ["franka", "spot"])
def test_the_scene_without_the_robot_is_the_exported_file(twin, exported, robot):
    world = build_world(twin, robots.resolve(robot), BASE, 0.4, visual=True)
    check_equal(world.model, exported)
    assert world.model.nq > exported.nq, "the robot is there"


def test_only_what_is_drawn_is_left_out_where_nothing_is_drawn(twin, exported):
    """Planning, rehearsals and trials run the same numbers."""
    world = build_world(twin, robots.resolve("franka"), BASE, 0.4)
    shapes = {n for n in table(exported, "geom") if exported.geom(n).contype[0]}
    assert table(world.model, "geom").keys() == shapes
    for name, value in options(exported).items():
        assert np.array_equal(options(world.model)[name], value), name
    part = twin.parts[0]
    for model in (world.model, perturbed(world, part, nominal(part)).model):
        for kind in MADE:
            rows = {n: r for n, r in table(exported, kind).items() if kind != "geom" or n in shapes}
            for row in rows.values():
                row.pop(
                    "dof_length", None
                )  # counts what is drawn, too; it is for sleeping alone, which none does
            check_rows(model, kind, rows)


@pytest.mark.parametrize(
    "field", ["opt.timestep", "opt.cone", "geom_friction", "geom_solref", "dof_armature", "jnt_range", "body_mass"]
)  # fmt: skip
def test_a_second_default_would_show(field, tmp_path):
    twin = furniture.drawer()
    theirs = mujoco.MjModel.from_xml_path(str(export(twin, tmp_path, formats=("mjcf",))["mjcf"]))
    ours = build_world(twin, robots.resolve("franka"), BASE, 0.4, visual=True).model
    check_equal(ours, theirs)
    if field.startswith("opt."):
        name = field.removeprefix("opt.")
        setattr(ours.opt, name, getattr(ours.opt, name) + 1)
    else:
        getattr(ours, field)[...] *= 1.01
    with pytest.raises(AssertionError):
        check_equal(ours, theirs)


def test_what_meets_what(twin):
    """The robot meets parts, static scene and itself; parts and static scene don't meet each other."""
    world = build_world(twin, robots.resolve("franka"), BASE, 0.4, visual=True)
    model = world.model

    def meet(a: int, b: int) -> bool:
        return bool(
            model.geom_contype[a] & model.geom_conaffinity[b]
            or model.geom_contype[b] & model.geom_conaffinity[a]
        )

    solid = np.flatnonzero(model.geom_contype)
    arm = [g for g in solid if model.body(model.geom_bodyid[g]).name.startswith(PREFIX)]
    furniture_ = [g for g in solid if world.owner[g] != world.owner[arm[0]]]
    assert all(meet(a, b) for a in arm for b in [*furniture_, *arm])
    assert not any(meet(a, b) for a in furniture_ for b in furniture_)
    assert {model.geom(g).name for g in furniture_} == {n for n in table(model, "geom") if "_collision_" in n}


def unfinished() -> Twin:
    """A twin as a reconstruction leaves it: without shapes, masses and friction."""
    twin = cabinet_twin()
    parts = tuple(replace(p, collision=(), inertial=None, physics=None) for p in twin.parts)
    return replace(twin, static=replace(twin.static, collision=()), parts=parts)


def test_the_verb_makes_shapes_once_and_hands_them_on(tmp_path, monkeypatch):
    """Plan, replay and trials of every part get one completed twin, and its shapes are kept where `twin
    export` keeps them."""
    bare = unfinished()
    save(bare, tmp_path / "twin")
    seen = []

    def plan(given, *_, **__):
        seen.append(given)
        raise PlanningError("none", "none")

    monkeypatch.setattr(robots, "plan", plan, raising=False)
    replay_step(silent, tmp_path, "franka", [])
    assert len(seen) == len(bare.parts) > 1
    assert all(t is seen[0] for t in seen)
    assert completed(seen[0]) is seen[0], "nothing is missing, so nothing is made again"
    assert list((tmp_path / "stages" / "collision").rglob("*.npz"))
    build_world(seen[0], robots.resolve("franka"), BASE, 0.4)


def test_what_is_asked_wrongly_is_told_before_shapes_are_made(tmp_path):
    twin = unfinished()
    save(twin, tmp_path / "twin")
    with pytest.raises(InputError, match="m off part"):
        replay_step(
            silent, tmp_path, "franka", [twin.parts[0].name], request=MotionRequest(contact=(0.0, -9.0, 0.5))
        )
    assert not (tmp_path / "stages").exists()
