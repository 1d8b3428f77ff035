"""Closed-form cabinets as a recording would leave them: a part is opened by a hand and rests there, alone in
view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.geometry import Array
from twin.physics import with_physics
from twin.scene import HAND_LABEL, Motion, Part, Twin

FRAMES, RATE, EVERY = 90, 15.0, 5
BEGIN, END = 30, 50  # the moving interval; the hand is in view from 20 to 60


def motion(start: float, state: float) -> Motion:
    """At rest at `start`, moved, at rest at `state`."""
    share = np.clip((np.arange(FRAMES) - BEGIN) / (END - BEGIN), 0.0, 1.0)
    states = start + (state - start) * share
    return Motion(np.arange(FRAMES), np.arange(FRAMES) / RATE, states, ((BEGIN, END),), 0.001, 1.0)


def labels(twin: Twin, hand: range = range(20, 61), every: int = EVERY) -> dict[int, NDArray[np.uint8]]:
    """Images in which all parts are seen, and in the frames of `hand` three pixels of a hand."""
    out = {}
    for frame in range(0, FRAMES, every):
        image = np.ones((6, 8), np.uint8)
        image[0, : len(twin.parts)] = [p.id for p in twin.parts]
        image[3, 2:5] = HAND_LABEL if frame in hand else 1
        out[frame] = image
    return out


def only(twin: Twin, *names: str) -> Twin:
    """Without its other parts: what is simulated takes its time."""
    return replace(twin, parts=tuple(p for p in twin.parts if p.name in names))


def left_at(twin: Twin, name: str, state: float, start: float = 0.0) -> Twin:
    """The twin with the exact masses that it has and no friction yet, in whose recording that part alone was
    moved from `start` to `state`."""
    parts = [
        replace(p, physics=None, motion=motion(start, state) if p.name == name else motion(0.0, 0.0))
        for p in twin.parts
    ]
    twin = replace(twin, parts=tuple(parts))
    return replace(twin, labels=labels(twin))


def by_law(twin: Twin) -> Twin:
    """With the friction that the table alone gives: no labels, no evidence."""
    bare = tuple(replace(p, physics=None) for p in twin.parts)
    return replace(with_physics(replace(twin, parts=bare, labels={})), labels=twin.labels)


def leaning(twin: Twin, name: str, angle: float, about: Array) -> Twin:
    """The twin with the axis of one joint turned by `angle` rad about a direction (3,) of the world."""

    def turned(part: Part) -> Part:
        axis = geo.exp_so3(angle * about) @ part.joint.axis
        return replace(part, joint=replace(part.joint, axis=geo.unit(axis)))

    return replace(twin, parts=tuple(turned(p) if p.name == name else p for p in twin.parts))


def cabinet(lid: bool = False) -> Twin:
    """The cabinet of benchmarks/scenes/boards.py, square to the world."""
    return cabinet_twin(np.eye(4), lid=lid)
