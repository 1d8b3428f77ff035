"""Parts by changed surfaces, each carried by the joint that explains it best through all frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.interaction.joints.observations import Model
from recon.interaction.joints.sign_and_limits import Oriented, orient, smoothed
from recon.interaction.motion.change.depths import Depths
from recon.interaction.motion.change.surfaces import changed_surfaces, informative_rows, novelty
from recon.interaction.parts.changed.carried import ROWS, CarriedSurface, CarriedSurfaces, Explained
from recon.interaction.parts.changed.panels import with_panels
from recon.interaction.parts.changed.proposals import Proposed, plane_of, proposed_joints
from recon.recording import Recording
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import Trajectory

# Chosen by us where no other source is named. Largest surfaces whose own shape proposes joints.
_FROM = 2
# Joints of each round that are searched around.
_IMPROVED = 3
# Least gain of the largest surface's mean score over leaving to somewhere unknown.
LEAST = 0.04
# Least gain of a further surface of the part.
_SAME = 0.01
# A further part explains at least this share of what the first part explains.
_FURTHER = 0.3
# The same of a part that moves while no part that explains more does, as a small drawer after a large door.
_IN_TURN = 0.1
# By how much that share grows with the share of frames in which both move.
_PER_SHARE = 0.2
# Share of a part's moving frames in which another part moves, from which the two move together.
MEANWHILE = 0.5
# Share of a part's fastest step from which the part moves.
_CREEPS = 0.1
# Greatest ratio of the tracks' travel to depth's: .85 to 1.05 in 15 right open recordings, 1.75 if wrong.
_FARTHER = 1.4
# Standard deviations of depth's states by which those of tracks leave them where the tracks slip, and share
# of the moving frames up to which most stay. Chosen by us.
_SLIPS, _MOSTLY = 3.0, 0.5
# Sine of a way to a surface that the part slides along.
_ALONG = 0.25
# Ratio by which a hinge must explain more than a slide, for its two further unknowns.
_SIMPLER = 1.02
# Standard deviation of a state, rad or m: the search's grid.
_SIGMA = {"revolute": np.radians(1.5), "prismatic": 0.008}
# The same of the axis, rad.
_SIGMA_AXIS = np.radians(2.0)
# The same of the pivot, m.
_SIGMA_PIVOT = 0.02


@dataclass(frozen=True, eq=False)
class ChangedPart:
    """A joint with states (T,), 0 at the first of `frames` (T,); its surfaces, largest first; its score."""

    joint: Proposed
    frames: NDArray[np.int64]
    state: Array
    score: float
    carried: CarriedSurfaces

    @property
    def surface(self) -> CarriedSurface:
        """The largest surface carried."""
        return self.carried.surfaces[0]

    def as_well(self, joint: Proposed, frames: NDArray[np.int64], state: Array) -> float:
        """Agreement of depth with another joint's states (n,) of frames (n,), over that with this joint.

        The states may be off by a step of the search, which refinement takes in. The ratio is 0 where they go
        farther than the surfaces were seen to: they ran on while the part was out of view. Depth is silent on
        a strip that slides in its own plane: the ratio is then that of the travels.
        """
        its = np.interp(self.frames, frames, state)
        ways = [float(np.ptp(np.quantile(s, (0.02, 0.98)))) for s in (its, self.state)]
        farther = ways[0] / max(ways[1], 1e-12)
        if self._silent:
            return farther
        if farther > _FARTHER:
            return 0.0
        return self._worth(joint, its) / max(self._worth(self.joint, self.state), 1e-12)

    def mended(self, joint: Proposed, frames: NDArray[np.int64], state: Array) -> tuple[Array, bool]:
        """States (n,) of frames (n,) by another joint, with those of depth where they are far from these, if
        so depth agrees better; and whether most states of the way stay. Tracks slip, or lie on a hand that
        lets go."""
        sense = np.sign(joint.axis @ self.joint.axis)
        own = sense * np.interp(frames, self.frames, self.state)
        own = own + np.median(state - own)
        slips = np.abs(state - own) > _SLIPS * _SIGMA[self.joint.kind]
        if self._silent or not slips.any():
            return state, True
        mended = np.where(slips, own, state)
        its, told = (np.interp(self.frames, frames, s) for s in (state, mended))
        if self._worth(joint, told) <= self._worth(joint, its):
            return state, True
        return mended, float(slips[_moving(own)].mean()) <= _MOSTLY

    @property
    def _silent(self) -> bool:
        normal, _ = plane_of(self.surface.points)
        along = self.joint.kind == "prismatic" and abs(float(normal @ self.joint.axis)) < _ALONG
        return along and not self.surface.panel

    def _worth(self, joint: Proposed, state: Array) -> float:
        rows = self.surface.rows
        return self.carried.near(joint, self.carried.following(joint, rows, state[rows]), 1).worth

    def oriented(self, quantile: float) -> Oriented:
        """The joint of a twin, positive along the motion, with limits and the search's uncertainty."""
        n = 4 if self.joint.kind == "revolute" else 2
        variance = (
            [_SIGMA_AXIS**2] * 2
            + [_SIGMA_PIVOT**2] * (n - 2)
            + [_SIGMA[self.joint.kind] ** 2] * len(self.state)
        )
        model = Model(self.joint.kind, self.joint.axis, self.joint.pivot, self.state)
        return orient(model, np.diag(variance), np.arange(len(self.state)), quantile)


def changed_parts(
    recording: Recording, cameras: Trajectory, known: Sequence[Proposed] = ()
) -> list[ChangedPart]:
    """The parts that explain the changed surfaces, by decreasing score.

    known: joints from elsewhere, which compete with those that a surface's shape suggests.
    """
    depths = Depths.of(recording, cameras)
    if len(depths.frames) < 8:
        return []
    surfaces: list[CarriedSurface] = []
    ends = (0, len(depths.frames) - 1)
    new = [novelty(depths, rest) for rest in ends]
    rows = informative_rows(new[0], new[1], ROWS)
    for changed, panel in with_panels(depths, *(changed_surfaces(depths, rest) for rest in ends)):
        surfaces.append(CarriedSurface.of(depths, changed, new[ends.index(changed.rest)], rows, panel))
    seconds = np.asarray(recording.times)[depths.frames]
    found: list[ChangedPart] = []
    while surfaces:
        surfaces.sort(key=lambda s: -s.area)
        best = _best(CarriedSurfaces(depths, surfaces, seconds), known)
        mine = best.gains >= _SAME
        if best.gains.max() < LEAST:
            surfaces = surfaces[1:]  # no joint carries the largest one
            continue
        carried = [s for s, m in zip(surfaces, mine, strict=True) if m]
        its = CarriedSurfaces(depths, carried, seconds)
        fine = its.followed(replace(best, gains=best.gains[mine]))
        state = smoothed(fine.state)
        found.append(ChangedPart(fine.joint, depths.frames, state - state[0], best.worth, its))
        surfaces = [s for s, m in zip(surfaces, mine, strict=True) if not m]
    return _worth_telling(sorted(found, key=lambda p: -p.score))


def _worth_telling(found: Sequence[ChangedPart]) -> list[ChangedPart]:
    """The parts (by decreasing score) that explain enough beside the others."""
    out: list[ChangedPart] = []
    for part in found:
        share = part.score / max(found[0].score, 1e-12)
        meanwhile = max((together(part.state, p.state) for p in out), default=0.0)
        in_turn = meanwhile < MEANWHILE and share >= _IN_TURN + _PER_SHARE * meanwhile
        if share >= _FURTHER or in_turn:
            out.append(part)
    return out


def together(state: Array, other: Array) -> float:
    """Share of the frames of change of states (n,) in which others (n,) change, too."""
    moving = _moving(state)
    return float(_moving(other)[moving].mean()) if moving.any() else 1.0


def _moving(state: Array) -> NDArray[np.bool_]:
    """The frames (n,) of change of states (n,)."""
    steps = np.abs(np.gradient(state))
    return np.asarray(steps > _CREEPS * steps.max())


def carried_along(state: Array, other: Array) -> float:
    """How far states (n,) go with others (n,), over how far those go: 1 if carried along."""
    mine, its = np.gradient(state), np.gradient(other)
    moving = np.abs(its) > _CREEPS * np.abs(its).max()
    return float(mine[moving] @ np.sign(its[moving])) / max(float(np.abs(its[moving]).sum()), 1e-12)


def _best(surfaces: CarriedSurfaces, known: Sequence[Proposed]) -> Explained:
    """The joint that explains most."""
    proposed = [j for points in _shapes(surfaces.surfaces) for j in proposed_joints(points)]
    first = sorted(each(surfaces.explained, [*proposed, *known]), key=_worth, reverse=True)
    return max(each(surfaces.improved, first[:_IMPROVED]), key=_worth)


def _shapes(surfaces: Sequence[CarriedSurface]) -> list[Array]:
    """Points (n, 3) of the largest surfaces, and of all that changed at one end: noise cuts doors up."""
    out = [s.points for s in surfaces[:_FROM]]
    for rest in sorted({s.rest for s in surfaces}):
        pieces = [s.points for s in surfaces if s.rest == rest]
        if len(pieces) > 1:
            out.append(np.concatenate(pieces))
    return out


def _worth(explained: Explained) -> float:
    return explained.worth / (_SIMPLER if explained.joint.kind == "revolute" else 1.0)
