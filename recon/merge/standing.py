"""In which state a part stands while nobody handles it, as far as frames show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from recon.dense import looks
from recon.merge.same_part import STEP, Surface
from recon.recording import Recording
from recon.recording.intrinsics import Intrinsics
from twin import geometry as geo
from twin.geometry import Array
from twin.joint import Joint
from twin.runs.threads import each
from twin.scene import Trajectory

# s between the frames that are asked, cells of a part that are asked for, and states from one that is asked
# first to the next. Chosen by us.
_EVERY_S = 0.5
_CELLS = 150
_COARSE = 3
# Frames of its interactions that tell what stands where it may stand. Chosen by us.
_ELSEWHERE = 10
# Of its cells those that then lie on something else, and how much farther than `SAME` the part then stands.
# Chosen by us.
_TAKEN, _APART = 0.15, 3.0
# m by which depth may differ from a surface that stands there: a cell, and drift of the cameras over a walk.
_GATE_M = 0.03
# Share of the cells of which a frame must tell. Chosen by us.
_IN_VIEW = 0.4
# Of the cells that no nearer thing hides, those that may be seen through; of all, those that must be there,
# of a state that is known and of one that nobody told. Chosen by us.
_THROUGH, _SOME, MUCH = 0.2, 0.25, 0.4
# Share of cells by which a state may be worse than the best one and as likely. Chosen by us.
_ALIKE = 0.05
# rad and m that states as likely may differ by, and those told by two frames in a row. Chosen by us.
_SPREAD = {"revolute": float(np.radians(8.0)), "prismatic": 0.06}
SAME = {"revolute": float(np.radians(4.0)), "prismatic": 0.02}


@dataclass(frozen=True, eq=False)
class Standing:
    """A part's joint, its surface at state 0, frames -> states in which its interactions show it, and the
    states (s,) in which it may stand."""

    joint: Joint
    surface: Surface
    known: Mapping[int, float]
    states: Array

    @cached_property
    def asked(self) -> Array:
        """Some cells (n, 3) of its surface."""
        points = self.surface.points
        return points[np.unique(np.linspace(0, len(points) - 1, min(_CELLS, len(points))).astype(int))]


def standing(
    joint: Joint, surface: Surface, known: Mapping[int, float], recording: Recording, cameras: Trajectory
) -> Standing:
    """A part that may stand anywhere in its known range and as far again on either side.

    States beyond the range count where frames show, while the part is elsewhere, that nothing stands there: a
    door turned into its cabinet lies on the side wall, one turned by 180 degrees on its neighbour's front.
    """
    low, high = min(known.values()), max(known.values())
    span, step = high - low, STEP[joint.kind]
    if joint.kind == "revolute":
        span = min(span, np.pi / 2)
    states = np.arange(low - span, high + span + step, step)
    beyond = (states < low - SAME[joint.kind]) | (states > high + SAME[joint.kind])
    frames = sorted(known)
    part = Standing(joint, surface, known, states[beyond])
    taken, empty = np.zeros((2, int(beyond.sum())), bool)
    for k in np.unique(np.linspace(0, len(frames) - 1, _ELSEWHERE).astype(int)):
        shown = Shown.of(frames[k], recording, cameras)
        assert shown is not None
        _, same, through = shown.looks(part, part.states)
        elsewhere = np.abs(part.states - known[frames[k]]) > _APART * SAME[joint.kind]
        taken |= elsewhere & (same >= _TAKEN) & (same > 2 * through)
        empty |= elsewhere & (through >= MUCH)
    beyond[beyond] = taken | ~empty
    return replace(part, states=states[~beyond])


def states_standing(
    parts: Sequence[Standing], recording: Recording, cameras: Trajectory
) -> list[dict[int, float]]:
    """Frames -> states of each part, also between and beside its interactions.

    Frames in between that show it are asked; a part keeps its state from one frame that tells it to the next
    that tells the same. Between two that tell different ones somebody moved it, and no state is told.
    """
    frames = _asked(cameras)

    def tell(frame: int) -> list[float | None]:
        shown = Shown.of(frame, recording, cameras)
        return [None if shown is None else _told(p, shown) for p in parts]

    told = list(each(tell, frames))
    out = []
    for k, part in enumerate(parts):
        seen = {f: s for f, row in zip(frames, told, strict=True) if (s := row[k]) is not None}
        out.append(_held(part, _confirmed(part, seen), cameras.frames.tolist()))
    return out


def _asked(cameras: Trajectory) -> list[int]:
    """Frames `_EVERY_S` apart."""
    out: list[int] = []
    last = -np.inf
    for frame, time in zip(cameras.frames.tolist(), cameras.times.tolist(), strict=True):
        if time - last >= _EVERY_S:
            out.append(int(frame))
            last = time
    return out


def _told(part: Standing, shown: Shown) -> float | None:
    """The state in which a frame shows a part; that in which an interaction left or found it if it fits."""
    if shown.frame in part.known:
        return None

    def shares(states: Array) -> tuple[Array, Array]:
        """Of the cells in view, those that are there and those that are seen through, in each state."""
        view, same, through = shown.looks(part, states)
        count = np.where(view >= _IN_VIEW, view, np.inf)
        return same / count, through / count

    def stands(same: Array, through: Array, least: float) -> NDArray[np.bool_]:
        return (same >= least) & (through <= _THROUGH * (same + through))

    beside = _beside(part, shown.frame)
    fitting = beside[stands(*shares(beside), _SOME)]
    if len(fitting):
        return float(fitting[0])
    states = part.states[::_COARSE]
    same, through = shares(states)
    near = np.abs(part.states[:, None] - states[np.argsort(through - same)[:2]]).min(axis=1)
    states = part.states[near < _COARSE * STEP[part.joint.kind]]
    same, through = shares(states)
    score = np.where(stands(same, through, MUCH), same - through, -1.0)
    best = float(score.max())
    alike = states[score >= best - _ALIKE]
    told = best > 0 and np.ptp(alike) <= _SPREAD[part.joint.kind]
    return float(np.median(alike)) if told else None


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame: its depth (H, W) m, the camera, and T_cam_world (4, 4)."""

    frame: int
    depth: NDArray[np.float32]
    camera: Intrinsics
    T_cam_world: Array

    @classmethod
    def of(cls, frame: int, recording: Recording, cameras: Trajectory) -> Self | None:
        """A frame of a recording; None without a camera."""
        pose = cameras.pose(frame)
        if pose is None:
            return None
        depth = np.ascontiguousarray(recording.depth(frame), np.float32)
        return cls(frame, depth, recording.intrinsics, geo.invert_pose(pose))

    def looks(self, part: Standing, states: Array) -> tuple[Array, Array, Array]:
        """Shares (s,) of a part's cells that are in view in each state, that are there, and that are seen
        through."""
        poses = np.ascontiguousarray(self.T_cam_world @ part.joint.poses(states))
        c, points = self.camera, part.asked
        seen = looks.count(points, poses, self.depth, c.fx, c.fy, c.cx, c.cy, _GATE_M) / max(len(points), 1)
        return seen[:, 1:].sum(axis=1), seen[:, looks.SAME], seen[:, looks.THROUGH]


def _beside(part: Standing, frame: int) -> Array:
    """The states (1 or 2,) known last before and first after a frame."""
    frames = np.array(sorted(part.known))
    at = int(np.searchsorted(frames, frame))
    return np.array([part.known[int(f)] for f in frames[max(at - 1, 0) : at + 1]])


def _confirmed(part: Standing, seen: Mapping[int, float]) -> dict[int, float]:
    """States told by frames, one for all in a row that tell nearly the same: that of an interaction beside
    them if it is near, else the median. What a single frame tells is left out."""
    same, out = SAME[part.joint.kind], dict[int, float]()
    runs: list[list[int]] = []
    for f in sorted(seen):
        goes_on = runs and abs(seen[f] - seen[runs[-1][-1]]) <= same
        if goes_on and not any(runs[-1][-1] < g < f for g in part.known):
            runs[-1].append(f)
        else:
            runs.append([f])
    for run in runs:
        beside = [s for f in run for s in _beside(part, f).tolist() if abs(seen[f] - s) <= same]
        if len(run) > 1 or beside:
            state = beside[0] if beside else float(np.median([seen[f] for f in run]))
            out |= dict.fromkeys(run, state)
    return out


def _held(part: Standing, seen: Mapping[int, float], frames: Iterable[int]) -> dict[int, float]:
    """The states of frames: as known or told, kept between two that tell the same."""
    same, told = SAME[part.joint.kind], {**seen, **part.known}
    anchors = sorted(told)
    ends = [(-1, anchors[0]), *pairwise(anchors), (anchors[-1], None)]
    out: dict[int, float] = {}
    wanted: NDArray[np.int64] = np.array(sorted(frames), np.int64)
    for before, after in ends:
        inside = wanted[(wanted > before) & (wanted < (np.inf if after is None else after))].tolist()
        if after is None or before < 0:
            out |= dict.fromkeys(inside, told[anchors[0] if before < 0 else before])
        elif abs(told[before] - told[after]) <= same:
            out |= dict.fromkeys(inside, told[before])
    return out | {f: told[f] for f in wanted.tolist() if f in told}
