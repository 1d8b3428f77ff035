"""The camera's path: a person walks up, looks at the part, sways, and sees the interaction to its end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from recon.simulate.acts import Act
from recon.simulate.config import Staging
from recon.simulate.grip import Grasp
from recon.simulate.mjcf import Articulation
from recon.simulate.sight import Surroundings, sight, surroundings
from recon.simulate.surfaces import Surface, merged_mesh
from recon.simulate.timeline import minimum_jerk
from twin.geometry import Array, exp_so3, make_pose, point_line_distance, transform, unit

EYE_HEIGHT = 1.6
FOLLOW = 0.4


def camera_path(
    acts: Sequence[Act],
    still: tuple[Surface, ...],
    bounds: tuple[Array, Array],
    config: Staging,
    rng: np.random.Generator,
) -> Array:
    """Poses T_world_camera (frames, 4, 4), OpenCV axes, with free sight of each act's grip while it lasts."""
    places = []
    for act in acts:
        around = surroundings(act.scene, act.states, still, bounds)
        places.append((_viewpoint(act.scene, around, act.grasp, config, rng), around))
    centres = _walk(acts, places, config, rng)
    target = _targets(acts, config)
    wobble = np.radians(config.sway) * sway(len(centres), config.fps, 0.8, 0.07, rng)
    n = len(centres)
    first_look = np.radians(rng.uniform(4.0, 9.0)) * rng.choice([-1.0, 1.0])
    ease = 1.0 - minimum_jerk(np.arange(n) / max(1, acts[0].line.grasp))
    out = np.empty((n, 4, 4))
    for i in range(n):
        look = look_at(centres[i], target[i])
        turn = wobble[i] + [0.3 * first_look * ease[i], first_look * ease[i], 0.0]
        out[i] = make_pose(look @ exp_so3(turn), centres[i])
    return out


def _targets(acts: Sequence[Act], config: Staging) -> Array:
    """What is looked at (frames, 3): between the grip and the middle of the part that is handled, or is
    handled next."""
    looked = []
    for act in acts:
        part = merged_mesh(list(act.scene.part))
        middle = 0.5 * np.asarray(part.bounds[0] + part.bounds[1])
        ends = np.stack([act.grasp.point, middle])
        held = np.stack([transform(act.scene.pose(float(s)), ends) for s in act.states])
        looked.append(0.6 * held[:, 0] + 0.4 * held[:, 1])
    target = looked[0]
    for before, act, place in zip(acts, acts[1:], looked[1:], strict=False):
        turned = (before.line.end + act.line.enter) // 2
        target = np.concatenate([target[:turned], place[turned:]])
    smoothed: Array = gaussian_filter1d(target, 0.35 * config.fps, axis=0, mode="nearest")
    return smoothed


def _viewpoint(
    scene: Articulation, around: Surroundings, grasp: Grasp, config: Staging, rng: np.random.Generator
) -> Array:
    """Best of a fan of viewpoints about a seeded (or the asked) bearing: grip and part stay in sight."""
    facing = unit(grasp.outward * [1.0, 1.0, 0.0]) if abs(grasp.outward[2]) < 0.9 else _facing(scene, around)
    right = np.cross([0.0, 0.0, 1.0], facing)
    asked = config.azimuth_deg
    bearing = float(rng.uniform(-30.0, 30.0)) if asked is None else asked
    distance = float(rng.uniform(0.0, 0.16)) + max(0.78, 0.6 + 0.75 * _radius(scene, grasp))
    distance = config.distance if config.distance is not None else distance
    rise = config.height_above_grip
    if rise is None:
        rise = float(np.clip(EYE_HEIGHT + around.low[2] - grasp.point[2], -0.12, 0.55))
    travel = float(around.states[-1] * (grasp.outward @ scene.axis)) if scene.kind == "prismatic" else 0.0
    base = grasp.point + max(0.0, travel) * 0.35 * facing  # a person stands clear of a drawer
    best, choice = -np.inf, base + distance * facing
    for turn in (0.0, 10.0, -10.0, 20.0, -20.0, 32.0, -32.0, 45.0, -45.0):
        for scale, lift in ((1.0, 0.0), (1.12, 0.0), (0.9, 0.0), (1.0, 0.15), (1.0, -0.15), (1.2, 0.15)):
            angle = np.radians(bearing + turn)
            away = np.cos(angle) * facing + np.sin(angle) * right
            eye = base + scale * distance * away + np.array([0.0, 0.0, rise + lift])
            score = (
                sight(scene, around, grasp, eye)
                - 0.006 * abs(turn)
                - 0.15 * abs(lift)
                - 0.3 * abs(scale - 1.0)
            )
            if score > best:
                best, choice = score, eye
    return choice


def _radius(scene: Articulation, grasp: Grasp) -> float:
    """How far the grip swings out: its distance from a hinge's axis, 0 for a slide."""
    return point_line_distance(grasp.point, scene.pivot, scene.axis) if scene.kind == "revolute" else 0.0


def _facing(scene: Articulation, around: Surroundings) -> Array:
    """For a part that faces up: the horizontal direction in which the room has most space."""
    middle = 0.5 * (scene.lower + scene.upper)
    space = np.concatenate([middle[:2] - around.low[:2], around.high[:2] - middle[:2]])
    directions = np.array([[-1.0, 0, 0], [0, -1.0, 0], [1.0, 0, 0], [0, 1.0, 0]])
    return directions[int(space.argmax())]


def _walk(
    acts: Sequence[Act],
    places: Sequence[tuple[Array, Surroundings]],
    config: Staging,
    rng: np.random.Generator,
) -> Array:
    """Camera centres (frames, 3): an approach of some 30 cm, a drift along with each part, half a step back.

    The person gives way by FOLLOW of the distance that the grip comes nearer, or follows when it goes away.
    """
    frames = acts[0].line.frames
    marks: list[float] = []
    points: list[Array] = []
    for act, (main, _) in zip(acts, places, strict=True):
        away = unit((main - act.grasp.point) * [1.0, 1.0, 0.0])
        side = np.cross([0.0, 0.0, 1.0], away) * float(rng.choice([-1.0, 1.0]))
        if not marks:
            start = (
                main
                + rng.uniform(0.18, 0.30) * away
                + rng.uniform(0.10, 0.24) * side
                + [0, 0, rng.uniform(-0.07, 0.05)]
            )
            marks += [0.0, 0.55 * act.line.grasp]
            points += [start, 0.3 * start + 0.7 * main]
        marks += [1.2 * act.line.grasp if len(points) == 2 else float(act.line.grasp), float(act.line.end)]
        drift = (
            main
            + FOLLOW * float(act.led @ away) * away
            + rng.uniform(0.03, 0.09) * away
            + rng.uniform(-0.09, 0.09) * side
            + [0, 0, rng.uniform(-0.03, 0.04)]
        )
        points += [main, drift]
    marks.append(float(frames + 2))
    points.append(drift + rng.uniform(0.05, 0.14) * away + rng.uniform(-0.08, 0.08) * side)
    around = places[0][1]
    low, high = around.low + 0.15, around.high - 0.12
    path = CubicSpline(marks, np.clip(np.stack(points), low, high), bc_type="clamped")(np.arange(frames))
    path = path + 0.01 * config.sway * sway(frames, config.fps, 1.3, 0.06, rng)
    if config.sidestep:
        there = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(frames) / frames)
        path = np.clip(path + config.sidestep * there[:, None] * side, low, high)
    return np.asarray(path)


def sway(frames: int, fps: float, slow: float, tremor: float, rng: np.random.Generator) -> Array:
    """Smooth noise (frames, 3): slow sway below 1 Hz of amplitude `slow`, tremor at 2 to 5 Hz of `tremor`."""
    t = np.arange(frames)[:, None] / fps
    out = np.zeros((frames, 3))
    for low, high, size, count in (
        (0.12, 0.4, 0.62 * slow, 3),
        (0.4, 1.0, 0.28 * slow, 3),
        (2.0, 5.0, tremor, 3),
    ):
        for _ in range(count):
            phase, rate = rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(low, high, 3)
            out += size / np.sqrt(count) * np.sin(2.0 * np.pi * rate * t + phase)
    return out


def look_at(eye: Array, target: Array) -> Array:
    """Rotation (3, 3) of a level camera (OpenCV axes) at `eye` that looks at `target`."""
    forward = unit(target - eye)
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    return np.stack([right, np.cross(forward, right), forward], axis=1)
