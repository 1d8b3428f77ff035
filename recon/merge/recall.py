"""A part that other windows show, in a window that could not be solved without them: its joint is taken over,
its states come from depth.

The part's surface, held into the depth of each frame in all its states, tells how it moves. What the window
itself takes for a part, moving meanwhile, is kept only where it explains as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recon.interaction.interaction import Interaction, cameras_of, frame_of
from recon.interaction.motion.intervals import state_intervals
from recon.interaction.parts.compete import followers
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.moving_part import MovingPart
from recon.merge.merge import Merged, Share, merge
from recon.merge.same_part import OVERLAP, STEP, Surface
from recon.merge.standing import MUCH, SAME, Shown, Standing, standing
from recon.recording import Recording
from recon.windows.windows import Window
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.threads import each
from twin.scene import FIRST_PART_ID, Motion, Trajectory

RECALL = Stage("recall", 3, ())

# Frames from one that is asked to the next, and what a step of the state costs, in shares of the surface.
# Chosen by us.
_EVERY = 2
_PER_STEP = 0.01


@dataclass(frozen=True, eq=False)
class Path:
    """States (n,) of a part in frames (n,) that explain most of their depth.

    fit: share of the surface that lies on depth, less what is seen through, mean of the frames. gain: cells
    by which the states explain more than the best one of them alone, added up over the frames.
    """

    frames: NDArray[np.int64]
    state: Array
    fit: float
    gain: float

    @property
    def moving(self) -> tuple[int, int] | None:
        """First and last frame of the motion; None where the part stands still."""
        changes = np.flatnonzero(np.diff(self.state))
        return (int(self.frames[changes[0]]), int(self.frames[changes[-1] + 1])) if len(changes) else None


@dataclass(frozen=True, eq=False)
class Recalled:
    """Parts that move in an interaction and that only others found, in the world of its window; why their
    joints have their types; ids of the interaction's own parts that are none."""

    interaction: int
    parts: tuple[MovingPart, ...]
    sources: tuple[str, ...]
    left_out: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Recall:
    """What all interactions show together at first, and those that are to be solved again."""

    merged: Merged
    again: tuple[Recalled, ...]


def recall(recording: Recording, cameras: Trajectory, interactions: Sequence[Interaction]) -> Recall:
    """The interactions in which parts move that only others found. All are in the world of the cameras."""
    merged = merge(recording, cameras, interactions)
    again = []
    for number, interaction in enumerate(interactions):
        own = {
            k: share
            for k, shares in enumerate(merged.shares)
            for share in shares
            if share.interaction == number
        }
        sought = _Window(recording, cameras, merged, interaction.window)
        asked = [k for k in range(len(merged.parts)) if k not in own and sought.may_show(k)]
        rivals = [k for k in own if merged.parts[k].carrier is None]
        paths, left_out = _recalled(sought, asked, rivals)
        if paths:
            parts = tuple(sought.part(k, path) for k, path in paths.items())
            sources = tuple(_source(merged.shares[k][0], interactions) for k in paths)
            again.append(Recalled(number, parts, sources, tuple(sorted(own[k].id for k in left_out))))
    return Recall(merged, tuple(again))


def _source(share: Share, interactions: Sequence[Interaction]) -> str:
    """Why a part's joint has its type, by the interaction that found it first."""
    return next(t.type_source for t in interactions[share.interaction].found.parts if t.part.id == share.id)


@dataclass(frozen=True, eq=False)
class _Window:
    """One window of a recording, in which the merged parts are looked for."""

    recording: Recording
    cameras: Trajectory
    merged: Merged
    window: Window

    @cached_property
    def posed(self) -> list[int]:
        """Its frames with a camera."""
        return [f for f in self.cameras.frames.tolist() if self.window.first <= f <= self.window.last]

    def may_show(self, k: int) -> bool:
        """Whether frames show a part in different states before, in or after the window. One that is carried
        is left alone."""
        frames, state = self.merged.parts[k].motion.frames, self.merged.parts[k].motion.state
        if not (len(frames) and self.posed) or self.merged.parts[k].carrier is not None:
            return False
        first = max(int(np.searchsorted(frames, self.window.first, side="right")) - 1, 0)
        last = int(np.searchsorted(frames, self.window.last)) + 1
        return float(np.ptp(state[first:last])) > SAME[self.merged.parts[k].joint.kind]

    def path(self, k: int) -> Path:
        """The states of a merged part."""
        part = self.merged.parts[k]
        motion = part.motion
        handled = np.logical_or.reduce([(motion.frames >= a) & (motion.frames <= b) for a, b in part.windows])
        states = dict(zip(motion.frames[handled].tolist(), motion.state[handled].tolist(), strict=True))
        surface = Surface(self.merged.surfaces[k])
        it = standing(part.joint, surface, states, self.recording, self.cameras)
        return path_of(it, self.posed[::_EVERY], self.recording, self.cameras)

    def lies_on(self, k: int, its: Path, j: int, other: Path) -> bool:
        """Whether a part, moved along a path, ends on the surface of another that moves along its own."""
        mine, others = (
            self.merged.parts[p].joint.pose(float(q.state[-1])) for p, q in ((k, its), (j, other))
        )
        surface, onto = (Surface(self.merged.surfaces[p]) for p in (k, j))
        return surface.covered_by(onto, geo.invert_pose(others) @ mine) >= OVERLAP

    def part(self, k: int, path: Path) -> MovingPart:
        """A merged part as it moves here, in the world of the window."""
        known, cameras = self.merged.parts[k], cameras_of(self.cameras, self.window)
        joint = known.joint.transformed(geo.invert_pose(frame_of(self.cameras, self.window)))
        state = np.interp(cameras.frames, path.frames - self.window.first, path.state)
        state = state - state[0]
        sigma = joint.sigma.state if joint.sigma is not None else 0.0
        spans = tuple((i.first, i.last) for i in state_intervals(cameras.frames, state, sigma))
        joint = replace(joint, lower=float(state.min()), upper=float(state.max()))
        return MovingPart(known.id, joint, Motion(cameras.frames, cameras.times, state, spans, 0.0, 0.0))


def _recalled(sought: _Window, asked: Sequence[int], own: Sequence[int]) -> tuple[dict[int, Path], set[int]]:
    """Of the parts asked for those that move, and of the window's own ones those that are none of them.

    A part that moves while an own one does, which explains as much, is not taken.
    """
    seen = {k: sought.path(k) for k in asked}
    kinds = [p.joint.kind for p in sought.merged.parts]
    moved = [k for k, p in seen.items() if p.fit >= MUCH and np.ptp(p.state) > 2 * SAME[kinds[k]]]
    there = {k: sought.path(k) for k in own} if moved else {}
    paths: dict[int, Path] = {}
    left_out: set[int] = set()
    for k in sorted(moved, key=lambda k: -seen[k].gain):
        rivals = {j: p for j, p in (there | paths).items() if j not in left_out and _together(seen[k], p)}
        if all(p.gain < seen[k].gain for p in rivals.values()):
            paths[k] = seen[k]
            left_out |= {j for j, p in rivals.items() if p.fit < MUCH or sought.lies_on(j, p, k, seen[k])}
    return paths, left_out


def _together(path: Path, other: Path) -> bool:
    """Whether two parts move at a time, as by one hand they can't; one that never moves is told to."""
    if path.moving is None or other.moving is None:
        return True
    return path.moving[0] <= other.moving[1] and other.moving[0] <= path.moving[1]


def path_of(part: Standing, frames: Sequence[int], recording: Recording, cameras: Trajectory) -> Path:
    """The states of a part that explain most of the depth of frames, by dynamic programming: each frame
    counts the cells that lie on depth less those that are seen through, each step costs a little."""
    states = part.states

    def explained(frame: int) -> Array:
        shown = Shown.of(frame, recording, cameras)
        assert shown is not None
        _, same, through = shown.looks(part, states)
        return same - through

    of_frames = np.stack(list(each(explained, list(frames))))
    cost = _PER_STEP * np.abs(states[:, None] - states) / STEP[part.joint.kind]
    best, came = of_frames[0], []
    for row in of_frames[1:]:
        ways = best[:, None] - cost
        came.append(ways.argmax(axis=0))
        best = ways.max(axis=0) + row
    at = [int(best.argmax())]
    for back in reversed(came):
        at.append(int(back[at[-1]]))
    way = np.array(at[::-1])
    along = of_frames[np.arange(len(way)), way]
    gain = len(part.surface.points) * float(along.sum() - of_frames.sum(axis=0).max())
    return Path(np.asarray(frames, np.int64), states[way], float(along.mean()), gain)


def found_again(recalled: Recalled, interaction: Interaction) -> FoundParts:
    """What an interaction found, with the parts that were recalled. Both are in the world of its window."""
    movers, found = interaction.found.movers, interaction.found
    tracks = [t for t in found.parts if t.part.id not in recalled.left_out]
    for part, source in zip(recalled.parts, recalled.sources, strict=True):
        members = followers(part.joint, part.motion.frames, part.motion.state, movers)
        share = float(members.sum()) / max(int(movers.moving.sum()), 1)
        tracks.append(PartTracks(replace(part, motion=replace(part.motion, inliers=share)), members, source))
    numbered = [replace(t, part=replace(t.part, id=FIRST_PART_ID + n)) for n, t in enumerate(tracks)]
    return FoundParts(movers, tuple(numbered))
