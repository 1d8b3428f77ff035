"""What moves besides furniture: carried things, curtains, people, films, hands in the air."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from recon.simulate.actors import Actor
from recon.simulate.acts import Act
from recon.simulate.grip import Grasp
from recon.simulate.hand_path import grip_pose
from recon.simulate.mjcf import Articulation
from recon.simulate.record import OTHER_LABEL
from recon.simulate.render import Body
from recon.simulate.script import Happening
from recon.simulate.surfaces import Surface, box
from recon.simulate.textures import Material, make_material
from recon.simulate.timeline import minimum_jerk
from twin.geometry import Array, exp_so3, make_pose, unit

UP = np.array([0.0, 0.0, 1.0])
Rng = np.random.Generator
# tangent from the middle of the view: less than half of the narrowest one drawn, 60 degrees wide
_ASIDE = 0.25, 0.42


def rng_of(seed: int) -> Rng:
    """Draws of one happening."""
    return np.random.default_rng([seed, 11])


@dataclass(frozen=True)
class Gestures(Happening):
    """The hand comes into view, is waved about in front of the furniture, and leaves: it touches nothing."""

    seed: int

    def leads(self, act: Act, cameras: Array) -> Array | None:
        """The hand some 10 to 30 cm in front of the grip, on a closed path of its own."""
        rng = rng_of(self.seed)
        start = grip_pose(act.grasp, cameras[act.line.grasp, :3, 3])
        towards = unit(cameras[act.line.grasp, :3, 3] - act.grasp.point)
        middle = act.grasp.point + rng.uniform(0.14, 0.30) * towards
        t = np.linspace(0.0, 2.0 * np.pi * rng.uniform(1.0, 2.5), act.line.frames)
        size, phase, rate = rng.uniform(0.04, 0.12, 3), rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.6, 1.4, 3)
        turn = rng.uniform(0.1, 0.5, 3)
        out = np.empty((len(t), 4, 4))
        for i, a in enumerate(t):
            wave = np.sin(rate * a + phase)
            out[i] = make_pose(start[:3, :3] @ exp_so3(turn * wave), middle + size * wave)
        return out


@dataclass(frozen=True)
class Carried(Happening):
    """A mug or a bag with a handle is lifted, carried to the side, turned and put down."""

    seed: int

    def act(self, act: Act) -> Act:
        """The thing stands where the furniture has room for it; it is looked at in place of the part."""
        rng = rng_of(self.seed)
        place, facing = self._place(act, rng)
        surfaces, handle = carried_thing(rng, facing)
        at_place = tuple(replace(s, vertices=s.vertices + place) for s in surfaces)
        scene = act.scene
        thing = Articulation(
            "carried", "prismatic", UP, place, 0.3, (*scene.static, *scene.part), at_place, 0.4, place,
            np.zeros(6), scene.lower, scene.upper, scene.has_floor, {},
        )  # fmt: skip
        grasp = Grasp(place + handle, UP, facing, 0.014, "handle")
        lifted = act.line.states([0.0, *np.full(len(act.line.turns) - 1, 0.2)])
        return Act(thing, grasp, act.line, lifted, True)

    def _place(self, act: Act, rng: Rng) -> tuple[Array, Array]:
        """On its own table before the furniture: top's middle (3,), direction to the person (3,)."""
        facing = unit(act.grasp.outward * [1.0, 1.0, 0.0] + [0.0, -1e-6, 0.0])
        side = np.cross(UP, facing) * rng.uniform(-0.3, 0.3)
        reach = float(np.max(np.concatenate([s.vertices for s in act.scene.part]) @ facing))
        level = act.scene.lower[2] + rng.uniform(0.7, 0.95)
        spot = act.grasp.point * [1.0, 1.0, 0.0] + side
        spot = spot + (reach + rng.uniform(0.18, 0.28) - spot @ facing) * facing
        return np.array([spot[0], spot[1], level]), facing

    def poses(self, act: Act) -> Array:
        """T_world_thing (frames, 4, 4) relative to where it stood first."""
        rng = rng_of(self.seed + 1)
        start, end = act.line.start, act.line.end
        base = act.scene.pivot
        lift, across, ahead = (
            rng.uniform(0.08, 0.2),
            rng.uniform(0.15, 0.35) * rng.choice([-1.0, 1.0]),
            rng.uniform(-0.08, 0.1),
        )
        side = np.cross(UP, act.grasp.outward)
        away = across * side + ahead * act.grasp.outward
        knots = np.stack([0 * away, 0.2 * away + 0.9 * lift * UP, 0.7 * away + lift * UP, away])
        path = CubicSpline([0.0, 0.3, 0.7, 1.0], knots, bc_type="clamped")
        turn, tilt = rng.uniform(-0.9, 0.9), rng.uniform(-0.3, 0.3)
        out = np.empty((act.line.frames, 4, 4))
        for i in range(act.line.frames):
            t = float(minimum_jerk((i - start) / (end - start)))
            swing = exp_so3(turn * t * UP) @ exp_so3(tilt * np.sin(np.pi * t) * side)
            out[i] = make_pose(swing, base + path(t) - swing @ base)
        return out

    def leads(self, act: Act, cameras: Array) -> Array | None:
        """The hand holds the thing's handle."""
        start = grip_pose(act.grasp, cameras[act.line.grasp, :3, 3])
        return np.asarray(self.poses(act) @ start)

    def actors(self, act: Act, cameras: Array, bounds: tuple[Array, Array]) -> list[Actor]:  # noqa: ARG002
        """The thing, and the table it stands on."""
        rng = rng_of(self.seed + 2)
        place = act.scene.pivot
        vertices, faces = box((0.9, 0.3, 0.025))
        lengthwise = unit(np.cross(UP, act.grasp.outward))
        turn = np.stack([lengthwise, np.cross(UP, lengthwise), UP], axis=1)
        board = vertices @ turn.T + place - 0.0125 * UP
        legs = []
        for s in (-0.42, 0.42):
            low, high = place + s * lengthwise - 0.02 * UP, place + s * lengthwise
            low = np.array([low[0], low[1], bounds[0][2]])
            legs.append(_rod(low, high - 0.02 * UP, 0.018))
        wood = make_material("wood", 1.0, rng)
        table = [Surface("table", board, faces, wood), *(_surface("leg", m, wood, rng) for m in legs)]
        still = Actor.still(Body(tuple(table), 1), act.line.frames)
        return [still, Actor.moving(Body(act.scene.part, OTHER_LABEL), self.poses(act))]


def carried_thing(rng: Rng, facing: Array) -> tuple[list[Surface], Array]:
    """Surfaces about the point on which the thing stands, and the middle of its handle (3,)."""
    material = make_material(str(rng.choice(["poster", "laminate", "speckle", "glossy"])), 1.0, rng)
    side = np.cross(UP, facing)
    if rng.random() < 0.5:  # a mug
        radius, tall = rng.uniform(0.035, 0.045), rng.uniform(0.09, 0.12)
        body = trimesh.creation.cylinder(radius=radius, height=tall, sections=32)
    else:  # a carton with a strap
        tall = float(rng.uniform(0.12, 0.22))
        radius = float(rng.uniform(0.05, 0.09))
        body = trimesh.creation.box(extents=[2 * radius, 1.4 * radius, tall])
    body.apply_translation([0.0, 0.0, tall / 2])
    middle = 0.5 * tall * UP + (radius + 0.035) * side
    bars = []
    for centre, half in (
        (middle, 0.035 * UP),
        *(((middle - 0.017 * side + s * 0.035 * UP), 0.02 * side) for s in (-1, 1)),
    ):
        bars.append(_rod(centre - half, centre + half, 0.007))
    return [_surface("carried", m, material, rng) for m in (body, *bars)], middle


@dataclass(frozen=True)
class Curtain(Happening):
    """A curtain beside the furniture in a draught: strips swing about their upper edges one by one."""

    seed: int
    strips: int = 10

    def actors(self, act: Act, cameras: Array, bounds: tuple[Array, Array]) -> list[Actor]:
        """One actor a strip."""
        rng = rng_of(self.seed)
        facing, side, spot = beside(act, cameras, rng, rng.uniform(0.05, 0.25))
        width, tall = float(rng.uniform(0.05, 0.08)), float(rng.uniform(1.1, 1.7))
        top = min(float(bounds[1][2]) - 0.1, float(act.grasp.point[2]) + 0.6 * tall)
        cloth = make_material("fabric", 1.0, rng)
        t = np.arange(act.line.frames)
        swing, rate, phase = rng.uniform(0.06, 0.16), rng.uniform(0.12, 0.3), rng.uniform(0, 2 * np.pi)
        out = []
        for k in range(self.strips):
            vertices, faces = box((width, 0.006, tall))
            turn = np.stack([side, np.cross(UP, side), UP], axis=1)
            hang = spot + (k - self.strips / 2) * 0.9 * width * side + (0.012 * (k % 2)) * facing
            hang = np.array([hang[0], hang[1], top])
            strip = Surface("curtain", vertices @ turn.T + hang - 0.5 * tall * UP, faces, cloth)
            angles = swing * np.sin(rate * t + phase - 0.5 * k) * (0.6 + 0.4 * np.sin(0.37 * rate * t))
            poses = np.stack([_about(hang, exp_so3(a * side)) for a in angles])
            out.append(Actor.moving(Body((strip,), OTHER_LABEL), poses))
        return out


@dataclass(frozen=True)
class SecondPerson(Happening):
    """Somebody comes and stands beside the furniture."""

    seed: int

    def actors(self, act: Act, cameras: Array, bounds: tuple[Array, Array]) -> list[Actor]:
        """Trunk with head and arms, and two legs that swing."""
        rng = rng_of(self.seed)
        _, side, spot = beside(act, cameras, rng, rng.uniform(0.1, 0.3))
        coat, trousers = (make_material(k, 1.0, rng) for k in ("stripes", "fabric"))
        skin = make_material("skin", 1.0, rng)
        floor = float(bounds[0][2])
        tall = float(rng.uniform(1.55, 1.9))
        frames = act.line.frames
        first = float(rng.uniform(0.05, 0.35))
        go = minimum_jerk((np.arange(frames) / frames - first) / rng.uniform(0.3, 0.5))
        outwards = float(np.sign((spot - act.grasp.point) @ side) or 1.0)
        left = (1.0 - go) * rng.uniform(0.5, 0.9) * outwards
        way = np.array([spot[0], spot[1], floor]) + left[:, None] * side
        turn = np.stack([side, np.cross(UP, side), UP], axis=1)
        upper = [
            _surface("coat", _rod(0.53 * tall * UP, 0.76 * tall * UP, 0.17), coat, rng),
            _surface("head", _rod(0.9 * tall * UP, 0.93 * tall * UP, 0.1), skin, rng),
        ]
        for s in (-1.0, 1.0):
            shoulder = np.array([0.0, 0.22 * s, 0.8 * tall])
            upper.append(
                _surface("coat", _rod(shoulder, shoulder - [0.05, 0.0, 0.3 * tall], 0.05), coat, rng)
            )
        bodies = np.stack([make_pose(turn, p) for p in way])
        out = [Actor.moving(Body(tuple(upper), OTHER_LABEL), bodies)]
        steps = np.sin(9.0 * go)
        for s in (-1.0, 1.0):
            hip = np.array([0.0, 0.1 * s, 0.5 * tall])
            leg = _surface("leg", _rod(hip, np.array([0.0, 0.1 * s, 0.06]), 0.08), trousers, rng)
            swung = np.stack([_about(hip, exp_so3(np.array([0.0, 0.4 * s * a, 0.0]))) for a in steps])
            out.append(Actor.moving(Body((leg,), OTHER_LABEL), bodies @ swung))
        return out


@dataclass(frozen=True)
class Screen(Happening):
    """A screen beside the furniture shows a film: flat pictures that change, and nothing moves."""

    seed: int
    pictures: int = 12

    def actors(self, act: Act, cameras: Array, bounds: tuple[Array, Array]) -> list[Actor]:
        """One actor a picture, each there in its turn."""
        rng = rng_of(self.seed)
        _, side, spot = beside(act, cameras, rng, rng.uniform(0.0, 0.1))
        wide, tall = float(rng.uniform(0.45, 0.8)), float(rng.uniform(0.3, 0.45))
        centre = np.array([spot[0], spot[1], act.grasp.point[2] + rng.uniform(-0.1, 0.25)])
        vertices, faces = box((wide, 0.03, tall))
        turn = np.stack([side, np.cross(UP, side), UP], axis=1)
        placed = vertices @ turn.T + centre
        foot = _rod(np.array([centre[0], centre[1], bounds[0][2]]), centre - 0.5 * tall * UP, 0.03)
        stand = _surface("stand", foot, make_material("metal", 1.0, rng), rng)
        frames, each = act.line.frames, int(rng.integers(2, 8))
        shown = (np.arange(frames) // each) % self.pictures
        out = [Actor.still(Body((stand,), 1), frames)]
        for k in range(self.pictures):
            picture = Surface("screen", placed, faces, make_material("poster", 1.0, rng))
            body = Body((picture,), OTHER_LABEL)
            out.append(replace(Actor.still(body, frames), present=shown == k))
        return out


def beside(act: Act, cameras: Array, rng: Rng, ahead: float) -> tuple[Array, Array, Array]:
    """Where the furniture faces (3,), to its side (3,), and a point (3,) `ahead` m before its front, to one
    side of the picture's middle but well within it.
    """
    facing = unit(act.grasp.outward * [1.0, 1.0, 0.0] + [0.0, -1e-6, 0.0])
    side = np.cross(UP, facing)
    part = np.concatenate([s.vertices for s in act.scene.part])
    middle = 0.5 * (part.min(axis=0) + part.max(axis=0))
    front = float((part @ facing).max() - middle @ facing)
    eye = cameras[act.line.start, :3, 3]
    away = float((eye - middle) @ facing) - front - ahead
    sign = float(rng.choice([-1.0, 1.0]))
    aside = sign * rng.uniform(*_ASIDE) * max(away, 0.3) * side
    return facing, side, middle + aside + (front + ahead) * facing


def _about(point: Array, turn: Array) -> Array:
    return make_pose(turn, point - turn @ point)


def _rod(start: Array, end: Array, radius: float) -> trimesh.Trimesh:
    """Capsule between two points."""
    length = float(np.linalg.norm(end - start))
    rod = trimesh.creation.capsule(height=length, radius=radius, count=[10, 18])
    rod.apply_translation([0.0, 0.0, -rod.bounds.mean(axis=0)[2]])
    turn, _ = Rotation.align_vectors([(end - start) / max(length, 1e-9)], [[0.0, 0.0, 1.0]])
    rod.apply_transform(make_pose(turn.as_matrix(), 0.5 * (start + end)))
    return rod


def _surface(name: str, mesh: trimesh.Trimesh, material: Material, rng: Rng) -> Surface:
    offset = make_pose(None, rng.uniform(-1.0, 1.0, 3))
    return Surface(name, np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64), material, offset)
