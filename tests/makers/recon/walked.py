"""A walk of 90 s past a door and two drawers, by its truth alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from recon.evaluation.metrics import Span
from recon.evaluation.truth import Truth, TruthPart
from recon.evaluation.walk_scores import WalkScores
from tests.makers.recon.tiny import DRAWER, JOINTS, STATIC, cameras, smooth
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Mesh, Part, Trajectory, Twin

FPS = 15
FRAMES = 90 * FPS
BESIDE = geo.make_pose(translation=[0.45, 0.0, 0.0])


def course(travel: float, *moves: tuple[int, int, float]) -> Array:
    """States (n,) of moves (last frame at rest, first one after it, share of the travel by which it goes)."""
    return travel * sum((share * smooth(FRAMES, a, b) for a, b, share in moves), np.zeros(FRAMES))


def true_part(
    id: int, name: str, joint: Joint, mesh: Mesh, grip: Array, states: Array, spans: list[Span]
) -> TruthPart:
    return TruthPart(id, name, joint, states, joint.poses(states), mesh, tuple(spans), grip)


def truth_of(*parts: TruthPart) -> Truth:
    """A walk with these parts: each has a band of the label images."""
    image = np.ones((40, 30), dtype=np.uint8)
    for k, p in enumerate(parts):
        image[5 * k : 5 * k + 5, :20] = p.id
    frames = np.arange(FRAMES)
    path = Trajectory(frames, frames / FPS, cameras(FRAMES))
    labels = dict.fromkeys(range(0, FRAMES, 100), image)
    return Truth(Path("walk/truth"), FRAMES, path, parts, labels, STATIC)


@cache
def walked() -> Truth:
    """A door that stays open for a minute, a drawer opened and shut twice, its like beside it, left open."""
    door, door_mesh, door_grip = JOINTS["door"]
    slide, _, grip = JOINTS["drawer"]
    again = course(0.3, (300, 345, 1), (360, 405, -1), (800, 845, 1), (860, 905, -1))
    return truth_of(
        true_part(
            2, "door", door, door_mesh, door_grip,
            course(1.2, (75, 135, 1), (1050, 1095, -1)), [(75, 135), (1050, 1095)],
        ),
        true_part(
            3, "drawer", slide, DRAWER, grip, again, [(300, 345), (360, 405), (800, 845), (860, 905)],
        ),
        true_part(
            4, "drawer_right", slide, DRAWER.transformed(BESIDE), geo.transform(BESIDE, grip[None])[0],
            course(0.3, (600, 660, 1)), [(600, 660)],
        ),
    )  # fmt: skip


def with_part(twin: Twin, name: str, change: Callable[[Part], Part]) -> Twin:
    return replace(twin, parts=tuple(change(p) if p.name == name else p for p in twin.parts))


def score(walk: WalkScores, name: str) -> tuple[str | None, str | None]:
    part = next(p for p in walk.parts if p.name == name)
    return part.found, part.cause
