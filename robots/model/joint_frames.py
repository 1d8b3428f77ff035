"""Whether two models of a robot move alike, and where the bodies of one lie in those of the other.

Body frames are a convention, joint axes are not. So the two are laid on each other by the axes of the joints
that both have, at our home state, and must then agree there and at other joint states. What no axis tells,
where a finger's or the first joint's zero is, must be told by body frames that are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array

# How far axes and bodies may lie apart (chosen by us): models of one arm differ by less, links by more.
APART = 1e-3  # m
TURNED = float(np.deg2rad(0.5))  # rad
_STATES = 8  # joint states that are compared beside the home state
_SHIFT = 0.1  # rad, a tenth of it in m: how far a joint's zero is moved to see whether the axes would tell
_SPREAD = 0.1  # least second singular value of the axes' directions: below it they are as good as parallel
_REMEDY = "that is another robot, or another version of it"


@dataclass(frozen=True, eq=False)
class Pose:
    """One joint state, told in the anchor body's frame. axes, origins: (j, 3), bodies: (b, 4, 4)."""

    axes: Array
    origins: Array
    bodies: Array


class Mover:
    """A model that is moved by some of its joints, seen from one of its bodies.

    Args:
        model: the compiled model.
        anchor: id of the body whose frame everything is told in.
        bodies: ids (b) of the bodies that are looked at.
        joints: ids (j) of hinges and slides that are moved; all others rest.
        hold: joint id -> where it rests (rad or m) if not at the model's own zero.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        anchor: int,
        bodies: Sequence[int],
        joints: Sequence[int],
        hold: Mapping[int, float],
    ) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._anchor, self._bodies, self._joints = anchor, list(bodies), list(joints)
        for joint, state in hold.items():
            self._data.qpos[model.jnt_qposadr[joint]] = state

    def at(self, states: Array) -> Pose:
        """What is where at joint states (j,)."""
        data = self._data
        data.qpos[self._model.jnt_qposadr[self._joints]] = states
        mujoco.mj_kinematics(self._model, data)
        T_anchor_world = geo.invert_pose(self._pose(self._anchor))
        return Pose(
            geo.rotate(T_anchor_world, data.xaxis[self._joints]),
            geo.transform(T_anchor_world, data.xanchor[self._joints]),
            np.stack([T_anchor_world @ self._pose(b) for b in self._bodies]),
        )

    def _pose(self, body: int) -> Array:
        return geo.make_pose(self._data.xmat[body].reshape(3, 3), self._data.xpos[body])


@dataclass(frozen=True, eq=False)
class Pair:
    """Two models of one robot. Of b pairs of bodies and j of joints, in the same order in both.

    Attributes:
        ours: moved by its j joints and then by any others that it has.
        theirs: moved by its j joints.
        body_names: (b) of ours and theirs.
        joint_names: (j) of theirs.
        hinges: (j,) True where the joint turns, False where it slides.
        home: (j + others,) our home state.
        lower: (j + others,) least joint state that is tried.
        upper: (j + others,) largest joint state that is tried.
    """

    ours: Mover
    theirs: Mover
    body_names: Sequence[tuple[str, str]]
    joint_names: Sequence[str]
    hinges: NDArray[np.bool_]
    home: Array
    lower: Array
    upper: Array

    def frames(self) -> Array:
        """Where their bodies lie in ours: T_ours_theirs (b, 4, 4).

        Raises InputError when joints or bodies lie more than `APART` or `TURNED` apart in any state.
        """
        j = len(self.joint_names)
        ours, theirs = self.ours.at(self.home), self.theirs.at(self.home[:j])
        T_anchors = self._laid(ours, theirs)
        self._same_axes(ours, theirs, T_anchors)
        frames = _between(ours, theirs, T_anchors)
        rng = np.random.default_rng(0)
        for _ in range(_STATES):
            states = rng.uniform(self.lower, self.upper)
            ours, theirs = self.ours.at(states), self.theirs.at(states[:j])
            self._same_axes(ours, theirs, T_anchors)
            now = _between(ours, theirs, T_anchors)
            for k in np.flatnonzero(_beyond(geo.invert_pose(frames) @ now)).tolist():
                mine, other = self.body_names[k]
                raise InputError(f"its body {other!r} does not move as our {mine!r} does", _REMEDY)
        self._same_zeros(frames)
        return frames

    def _laid(self, ours: Pose, theirs: Pose) -> Array:
        """Their anchor's frame in ours (4, 4), by the axes: directions and hinge lines."""
        j, hinges = len(self.joint_names), self.hinges
        u, p = ours.axes[:j], ours.origins[:j]
        if j < 2 or np.linalg.svd(theirs.axes, compute_uv=False)[1] < _SPREAD:
            raise InputError("the joints that both models have are all parallel, or fewer than two", _REMEDY)
        turn = Rotation.align_vectors(u, theirs.axes)[0].as_matrix()
        across = np.eye(3) - u[hinges, :, None] * u[hinges, None, :]
        gap = (p - theirs.origins @ turn.T)[hinges]
        left = across.reshape(-1, 3)
        shift, _, rank, _ = np.linalg.lstsq(left, (across @ gap[:, :, None]).ravel())
        if rank < 3:
            raise InputError("the hinges that both models have are all parallel, or fewer than two", _REMEDY)
        return geo.make_pose(turn, shift)

    def _off(self, ours: Pose, theirs: Pose, T_anchors: Array) -> tuple[Array, Array]:
        """How far each axis of theirs lies from ours: (j,) m and (j,) rad."""
        u = ours.axes[: len(self.joint_names)]
        cosine = np.sum(u * geo.rotate(T_anchors, theirs.axes), axis=1)
        gap = ours.origins[: len(u)] - geo.transform(T_anchors, theirs.origins)
        gap = gap - np.sum(gap * u, axis=1, keepdims=True) * u
        return np.where(self.hinges, np.linalg.norm(gap, axis=1), 0.0), np.arccos(np.clip(cosine, -1, 1))

    def _same_axes(self, ours: Pose, theirs: Pose, T_anchors: Array) -> None:
        apart, turned = self._off(ours, theirs, T_anchors)
        worst = int(np.argmax(np.maximum(apart / APART, turned / TURNED)))
        if apart[worst] > APART or turned[worst] > TURNED:
            raise InputError(
                f"its joint {self.joint_names[worst]!r} lies {1000 * apart[worst]:.1f} mm and "
                f"{np.rad2deg(turned[worst]):.1f}° off ours, {1000 * APART:g} mm and {np.rad2deg(TURNED):g}° are allowed",
                _REMEDY,
            )

    def _same_zeros(self, frames: Array) -> None:
        """Refuse a joint whose zero neither the axes tell nor frames that are the same."""
        alike = ~_beyond(frames)
        j = len(self.joint_names)
        ours = self.ours.at(self.home)
        for i in range(j):
            states = self.home[:j].copy()
            states[i] += _SHIFT if self.hinges[i] else _SHIFT / 10
            theirs = self.theirs.at(states)
            T_anchors = self._laid(ours, theirs)
            apart, turned = self._off(ours, theirs, T_anchors)
            if apart.max() > APART or turned.max() > TURNED:
                continue
            shifted = _between(ours, theirs, T_anchors)
            moved = _beyond(geo.invert_pose(frames) @ shifted)
            told = {self.body_names[k][0] for k in np.flatnonzero(alike).tolist()}
            for k in np.flatnonzero(moved).tolist():
                mine, other = self.body_names[k]
                if mine not in told:
                    raise InputError(
                        f"nothing tells where its joint {self.joint_names[i]!r} has its zero: no other axis, and its body "
                        f"{other!r} has another frame than our {mine!r}",
                        _REMEDY,
                    )


def _between(ours: Pose, theirs: Pose, T_anchors: Array) -> Array:
    """Where their bodies lie in ours, (b, 4, 4)."""
    return geo.invert_pose(ours.bodies) @ T_anchors @ theirs.bodies


def _beyond(moves: Array) -> NDArray[np.bool_]:
    """(n,) whether rigid moves (n, 4, 4) are more than what is allowed."""
    apart, turned = np.linalg.norm(moves[:, :3, 3], axis=1), geo.rotation_angle(moves[:, :3, :3])
    return np.asarray((apart > APART) | (turned > TURNED))
