"""Parts of several interactions made one: joints combined by their uncertainty, states over all frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recon.interaction.interaction import Interaction, cameras_of, frames_of
from recon.interaction.parts.found import FoundParts
from recon.interaction.parts.moving_part import MovingPart
from recon.merge.carried import on_carriers
from recon.merge.same_part import Surface, match, surface_of
from recon.merge.standing import standing, states_standing
from recon.recording import Recording
from twin.geometry import Array
from twin.joint import Joint, JointSigma, turned_covariance
from twin.runs.keys import Stage
from twin.scene import FIRST_PART_ID, Motion, Trajectory

MERGE = Stage("merge", 7, ())


@dataclass(frozen=True)
class Share:
    """One part of one interaction: its state, times sign, plus offset, is the merged part's.

    as_left: whether it was in the state in which the interaction before left it.
    """

    interaction: int
    id: int
    sign: float
    offset: float
    as_left: bool


@dataclass(frozen=True, eq=False)
class Merged:
    """The parts of all interactions, and by which of these each was found. part.id: FIRST_PART_ID + place.

    surfaces: cells (n, 3) m of each part's surface at state 0, its carrier's too; none where there is one
    interaction.
    """

    parts: tuple[MovingPart, ...]
    shares: tuple[tuple[Share, ...], ...]
    surfaces: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class _Gathered:
    joint: Joint
    surface: Surface
    shares: tuple[Share, ...]
    left: float


def merge(recording: Recording, cameras: Trajectory, interactions: Sequence[Interaction]) -> Merged:
    """Merge what several interactions found. One interaction of all frames stays as it is."""
    if len(interactions) == 1 and interactions[0].window.is_whole(recording):
        parts = interactions[0].parts
        return Merged(parts, tuple((Share(0, p.id, 1.0, 0.0, True),) for p in parts))
    found: list[_Gathered] = []
    for number, interaction in enumerate(interactions):
        window = interaction.window
        part_of = frames_of(recording, window)
        its_cameras = cameras_of(cameras, window)
        for part in interaction.parts:
            surface = surface_of(part, part_of, its_cameras, interaction.labels)
            _gather(found, number, part, surface)
    known = [_known(g, interactions) for g in found]
    of_parts = [
        standing(g.joint, g.surface, k, recording, cameras) for g, k in zip(found, known, strict=True)
    ]
    states = states_standing(of_parts, recording, cameras)
    parts = tuple(
        _over_all(FIRST_PART_ID + k, g, states[k], recording, interactions) for k, g in enumerate(found)
    )
    parts, surfaces = on_carriers(parts, [g.surface for g in found])
    return Merged(parts, tuple(g.shares for g in found), tuple(s.points for s in surfaces))


def _gather(found: list[_Gathered], number: int, part: MovingPart, surface: Surface) -> None:
    """Add a part of an interaction to the known ones."""
    end = float(np.median(part.motion.state[-5:]))
    for k, g in enumerate(found):
        again = match(g.joint, g.surface, g.left, part.joint, surface)
        if again is None or any(s.interaction == number for s in g.shares):
            continue
        joint = combined(g.joint, part.joint if again.sign > 0 else part.joint.reversed(), g.surface)
        points = joint.pose(again.offset)
        share = Share(number, part.id, again.sign, again.offset, again.as_left)
        back = np.linalg.inv(points)
        both = np.concatenate([g.surface.points, surface.points @ back[:3, :3].T + back[:3, 3]])
        found[k] = _Gathered(joint, Surface(both), (*g.shares, share), again.sign * end + again.offset)
        return
    found.append(_Gathered(part.joint, surface, (Share(number, part.id, 1.0, 0.0, True),), end))


def combined(joint: Joint, other: Joint, surface: Surface) -> Joint:
    """Both joints as one, weighted by information at the part's middle; states count as the first's."""
    if joint.covariance is None or other.covariance is None:
        return joint if joint.covariance is not None else other
    middle = surface.points.mean(axis=0) if len(surface.points) else np.zeros(3)
    mine, its = joint.with_pivot(middle), other.with_pivot(middle)
    assert mine.covariance is not None
    assert its.covariance is not None
    theirs = turned_covariance(its.covariance, its.basis, mine.basis)
    gain = mine.covariance @ np.linalg.inv(mine.covariance + theirs)
    covariance = (np.eye(len(gain)) - gain) @ mine.covariance
    covariance = 0.5 * (covariance + covariance.T)
    moved = replace(mine, covariance=covariance).plus(gain @ its.minus(mine))
    states = [j.sigma.state for j in (joint, other) if j.sigma is not None]
    assert moved.covariance is not None
    return replace(moved, sigma=JointSigma.of(moved.covariance, max(states, default=0.0)))


def _known(g: _Gathered, interactions: Sequence[Interaction]) -> dict[int, float]:
    """Frames of the recording -> states, as the part's interactions have them."""
    out: dict[int, float] = {}
    for share in g.shares:
        motion, first = _motion(share, interactions)
        states = share.sign * motion.state + share.offset
        out |= dict(zip((motion.frames + first).tolist(), states.tolist(), strict=True))
    return out


def _motion(share: Share, interactions: Sequence[Interaction]) -> tuple[Motion, int]:
    """A part's motion in an interaction, whose frames count from the second result."""
    interaction = interactions[share.interaction]
    return next(p.motion for p in interaction.parts if p.id == share.id), interaction.window.first


def _over_all(
    number: int,
    g: _Gathered,
    states: Mapping[int, float],
    recording: Recording,
    interactions: Sequence[Interaction],
) -> MovingPart:
    """The part with states by frame of the recording."""
    frames = np.array(sorted(states), np.int64)
    state = np.array([states[f] for f in frames.tolist()])
    motions = [_motion(share, interactions) for share in g.shares]
    motion = Motion(
        frames,
        np.asarray(recording.times)[frames],
        state,
        tuple(sorted((a + first, b + first) for m, first in motions for a, b in m.intervals)),
        float(np.mean([m.residual for m, _ in motions])),
        float(np.mean([m.inliers for m, _ in motions])),
    )
    joint = replace(g.joint, lower=min(float(state.min()), 0.0), upper=max(float(state.max()), 0.0))
    windows = tuple((w.first, w.last) for w in (interactions[s.interaction].window for s in g.shares))
    return MovingPart(number, joint, motion, windows)


def as_merged(interaction: Interaction, number: int, merged: Merged) -> Interaction:
    """An interaction whose parts have the merged ones' ids; their joints and states stay its own."""
    ids = {
        s.id: p.id
        for p, shares in zip(merged.parts, merged.shares, strict=True)
        for s in shares
        if s.interaction == number
    }
    if all(k == v for k, v in ids.items()):
        return interaction
    table = np.arange(256, dtype=np.uint8)
    for old, new in ids.items():
        table[old] = new
    found = FoundParts(
        interaction.found.movers,
        tuple(
            replace(t, part=replace(t.part, id=ids[t.part.id]))
            for t in interaction.found.parts
            if t.part.id in ids
        ),
    )
    return Interaction(
        interaction.window,
        found,
        tuple(replace(p, id=ids[p.id]) for p in interaction.parts),
        {f: table[image] for f, image in interaction.labels.items()},
    )
