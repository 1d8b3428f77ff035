"""What the probes share: numpy only."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def pose(rotation: ArrayLike, position: ArrayLike) -> Array:
    """Pose (4, 4) from a rotation (3, 3) and a position (3,)."""
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = rotation, position
    return t


def rotation_xyzw(quat: ArrayLike) -> Array:
    """Rotation (3, 3) of a quaternion x, y, z, w of any length."""
    x, y, z, w = np.asarray(quat, dtype=np.float64) / np.linalg.norm(np.asarray(quat, dtype=np.float64))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def bounds(points: ArrayLike, T: Array) -> list[list[float]]:
    """Bounds (2, 3) of points (n, 3) placed by a pose."""
    world = np.asarray(points, dtype=np.float64) @ T[:3, :3].T + T[:3, 3]
    return [world.min(axis=0).tolist(), world.max(axis=0).tolist()]


def around(found: list[list[list[float]]]) -> list[list[float]] | None:
    """Bounds (2, 3) of several, null of none."""
    if not found:
        return None
    lows, highs = zip(*found, strict=True)
    return [np.min(lows, axis=0).tolist(), np.max(highs, axis=0).tolist()]


def tensor(rotation: Array, moments: ArrayLike) -> list[list[float]]:
    """World tensor of principal moments (3,) along a rotation's columns, or of a tensor (3, 3) in axes."""
    inner = np.asarray(moments, dtype=np.float64)
    inner = np.diag(inner) if inner.ndim == 1 else inner
    full: list[list[float]] = (rotation @ inner @ rotation.T).tolist()
    return full


def without_step_error(simulate: Callable[[float], Array], step: float, enough: float) -> Array:
    """The joints' course (t, n) as the step (s), a divisor of the times, goes to 0 (first order).

    Richardson's extrapolation, 2 f(h / 2) - f(h), with the step halved until that moves by less than `enough`
    of the way (up to six times); then once more, (4 b - a) / 3, for the error of second order. Else what
    moved least is taken: long steps suffer from a stiff joint, short ones from rounding in single precision.
    """
    last = simulate(step)
    before = calmest = np.full_like(last, np.inf)
    least = np.inf
    for _ in range(6):
        step /= 2
        now = simulate(step)
        best = 2 * now - last
        change = float(np.max(np.abs(best - before) / np.maximum(np.ptp(best, axis=0), 0.05)))
        if change <= enough:
            return (4 * best - before) / 3
        if not change > least:
            calmest, least = best, change
        last, before = now, best
    return calmest


def stepped(
    times: Sequence[float], step: float, advance: Callable[[], object], read: Callable[[], ArrayLike]
) -> Array:
    """What is read (t, n) at `times` (s, increasing) of a simulation that `advance` takes on a step (s)."""
    course, done = [], 0
    for until in times:
        for _ in range(round(until / step) - done):
            advance()
        done = round(until / step)
        course.append(np.asarray(read(), dtype=np.float64))
    return np.array(course)


def keep(out: dict[str, Any], field: str, values: Array, parts: Sequence[str]) -> None:
    """Hand columns of `values` (..., n) to the parts, in order."""
    for k, name in enumerate(parts):
        out[name][field] = np.asarray(values)[..., k].tolist()


def edited_urdf(path: Path, folder: Path, visuals: bool, limits: bool) -> Path:
    """A copy of a URDF in another folder, with or without visuals and limits, meshes by full path."""
    tree = ET.parse(path)  # noqa: S314  (a file that was just exported, in a process of its own)
    for link in tree.getroot().iter("link"):
        for visual in [] if visuals else link.findall("visual"):
            link.remove(visual)
    for limit in [] if limits else tree.getroot().iter("limit"):
        limit.attrib |= {"lower": "-10000", "upper": "10000"}
    for mesh in tree.getroot().iter("mesh"):
        mesh.set("filename", str(path.parent / mesh.get("filename", "")))
    tree.write(folder / path.name)
    return folder / path.name
