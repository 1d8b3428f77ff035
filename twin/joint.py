"""Joints of one degree of freedom and their algebra: small moves, their uncertainty, other frames.

The tangent of a joint: tilts (rad) of the axis about the two columns of `Joint.basis`, then, for a hinge,
shifts (m) of the axis along them at the pivot. Joints are moved, compared and sampled in these.

FunREC, supplement 1.1, eq. 1 and 2: another point on the same axis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.quantities import Described, require_sane
from twin.quantities import frozen_array as _frozen
from twin.quantities import set_field as _set


def moved_axis(axis: Array, pivot: Array, delta: ArrayLike) -> tuple[Array, Array]:
    """Axis (3,) and pivot (3,) m moved by a tangent (2,) or (4,): tilts, then shifts along the old basis."""
    delta = geo.as_float(delta)
    basis = geo.orthogonal_basis(axis)[:, :2]
    tilted = geo.unit(geo.exp_so3(basis @ delta[:2]) @ axis)
    return tilted, pivot + basis @ delta[2:4] if len(delta) > 2 else pivot


def turned_covariance(covariance: Array, old: Array, new: Array) -> Array:
    """A tangent's covariance (2, 2) or (4, 4) in basis `old` (3, 2), in basis `new` (3, 2) of that plane."""
    turn = np.kron(np.eye(len(covariance) // 2), new.T @ old)
    turned = turn @ covariance @ turn.T
    return np.asarray(0.5 * (turned + turned.T))


@dataclass(frozen=True)
class JointSigma:
    """One standard deviation of a joint per direction: of the axis' tilt (rad) about any one axis normal to
    it, of its position (m, None if prismatic) along any one direction normal to it, of a state (m or rad)."""

    axis: float
    pivot: float | None
    state: float

    @classmethod
    def of(cls, covariance: Array, state: float) -> JointSigma:
        """From a joint's covariance (2, 2) or (4, 4): root of the mean variance over two directions."""
        tilt, *shift = (
            float(np.sqrt(max(np.trace(covariance[k : k + 2, k : k + 2]) / 2, 0.0)))
            for k in range(0, len(covariance), 2)
        )
        return cls(tilt, shift[0] if shift else None, state)


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Described, ABC):
    """One-degree-of-freedom joint. `lower` <= 0 <= `upper` hold the limits in metres or radians.

    `pose(a) @ pose(b) == pose(a + b)` and `pose(0)` is the identity. `covariance` is over the tangent of the
    joint in `basis`: the axis tilts (rad) about its columns, then, for a revolute joint, the shifts (m) of
    the axis along those columns at the pivot.
    """

    axis: Array
    lower: float = 0.0
    upper: float = 0.0
    covariance: Array | None = None
    sigma: JointSigma | None = None

    kind: Literal["prismatic", "revolute"] = field(init=False, default="prismatic")
    _dof: int = field(init=False, default=2)

    def __post_init__(self) -> None:
        _set(self, "axis", _frozen(self.axis, (3,), "joint axis"))
        norm = float(np.linalg.norm(self.axis))
        if abs(norm - 1.0) > 1e-6:
            raise SceneError(f"joint axis must have length 1, got {norm:.6g}", "divide it by its length")
        if not (np.isfinite(self.lower) and np.isfinite(self.upper) and self.lower <= self.upper):
            raise SceneError(
                f"joint limits must be finite with lower <= upper, got {self.lower}..{self.upper}"
            )
        require_sane(max(-self.lower, self.upper), "a joint limit")
        if self.covariance is not None:
            c = _frozen(self.covariance, (self._dof, self._dof), "joint covariance")
            if not np.allclose(c, c.T, atol=1e-12) or np.linalg.eigvalsh(c).min() < -1e-12:
                raise SceneError("joint covariance must be symmetric and not negative")
            _set(self, "covariance", c)

    @property
    def dof(self) -> int:
        """Unknowns of its tangent: two tilts, and two shifts of a pivot."""
        return self._dof

    def pose(self, state: float) -> Array:
        """Pose (4, 4) of the part at `state` relative to state 0, in the world frame."""
        return self.poses(state)[0]

    @abstractmethod
    def poses(self, states: Any) -> Array:
        """Poses (n, 4, 4) for states (n,)."""

    @abstractmethod
    def velocity(self, state: float, point: Any) -> Array:
        """Derivative (3,) by the state of a part point given in the world at state 0."""

    @property
    def basis(self) -> Array:
        """The two directions (3, 2), normal to the axis, of the joint's tangent."""
        return geo.orthogonal_basis(self.axis)[:, :2]

    def plus(self, delta: ArrayLike) -> Self:
        """The joint moved by a tangent (2,) or (4,) in `basis`; limits and sigma stay, covariance follows.

        A hinge's pivot is shifted, not turned: `joint.plus(d).minus(joint)` is d again, up to half a turn of
        tilt. The shifts of a slide, which has no place, are nothing.
        """
        delta = geo.as_float(delta)
        if not np.any(delta):
            return self
        axis, pivot = moved_axis(self.axis, self._place(), delta)
        carried = geo.exp_so3(self.basis @ delta[:2]) @ self.basis
        return self._at(axis, pivot, carried)

    def minus(self, other: Joint) -> Array:
        """The tangent (2,) or (4,) in the other's basis by which that one becomes this one, as a line:
        `other.plus(delta)` has this axis, and a pivot on this line.

        Raises SceneError for another kind, and for hinges whose axes cross at a right angle.
        """
        if other.kind != self.kind:
            raise SceneError(f"a {self.kind} joint minus a {other.kind} one is not defined")
        across = np.cross(other.axis, self.axis)
        sine, cosine = float(np.linalg.norm(across)), float(other.axis @ self.axis)
        # Opposite axes: any tilt by half a turn will do.
        tilt = across / sine if sine > 1e-12 else other.basis[:, 0]
        tilts = other.basis.T @ tilt * np.arctan2(sine, cosine)
        if self._dof == 2:
            return np.asarray(tilts)
        if abs(cosine) < 1e-9:
            raise SceneError("the axes are at right angles: no shift brings one to the other")
        gap = self._place() - other._place()
        gap = gap - self.axis * ((gap @ other.axis) / cosine)
        return np.concatenate([tilts, other.basis.T @ gap])

    def reversed(self) -> Self:
        """The same motion counted the other way: `joint.reversed().pose(-s)` is `joint.pose(s)`."""
        return replace(self._at(-self.axis, self._place(), self.basis), lower=-self.upper, upper=-self.lower)

    def with_pivot(self, point: ArrayLike) -> Self:  # noqa: ARG002  (a hinge has a pivot)
        """The same joint with its pivot at the point of the axis nearest to `point` (3,) m; slides stay."""
        return self

    def transformed(self, T_new_old: Array) -> Self:
        """The same joint in another world frame, its uncertainty included."""
        axis = geo.unit(geo.rotate(T_new_old, self.axis))
        pivot = geo.transform(T_new_old, self._place()[None])[0]
        return self._at(axis, pivot, geo.rotate(T_new_old, self.basis.T).T)

    def _place(self) -> Array:
        """A point (3,) m that moves with the axis; of a slide, which has no place, the origin."""
        return np.zeros(3)

    def _at(self, axis: Array, pivot: Array, carried: Array) -> Self:  # noqa: ARG002  (a slide has no pivot)
        """This joint at another axis, to which the old basis was carried as `carried` (3, 2)."""
        return replace(self, axis=axis, covariance=self._carried(axis, carried))

    def _carried(self, axis: Array, carried: Array) -> Array | None:
        if self.covariance is None:
            return None
        return turned_covariance(self.covariance, carried, geo.orthogonal_basis(axis)[:, :2])


@dataclass(frozen=True, eq=False, repr=False)
class Prismatic(Joint):
    """Sliding joint (drawer, sliding door); states in metres along `axis`."""

    kind: Literal["prismatic", "revolute"] = field(init=False, default="prismatic")
    _dof: int = field(init=False, default=2)

    def poses(self, states: Any) -> Array:
        return geo.make_pose(translation=self.axis * np.atleast_1d(states)[:, None])

    def velocity(self, state: float, point: Any) -> Array:  # noqa: ARG002  (the same everywhere)
        return np.array(self.axis)


@dataclass(frozen=True, eq=False, repr=False)
class Revolute(Joint):
    """Hinge (door, lid) about `axis` through `pivot` (3,) m; states in radians, right-handed."""

    pivot: Array = field(kw_only=True)
    kind: Literal["prismatic", "revolute"] = field(init=False, default="revolute")
    _dof: int = field(init=False, default=4)

    def __post_init__(self) -> None:
        super().__post_init__()
        _set(self, "pivot", _frozen(self.pivot, (3,), "joint pivot"))

    def poses(self, states: Any) -> Array:
        r = geo.exp_so3(self.axis * np.atleast_1d(states)[:, None])
        return geo.make_pose(r, self.pivot - r @ self.pivot)

    def velocity(self, state: float, point: Any) -> Array:
        moved = geo.transform(self.pose(state), np.asarray(point, dtype=np.float64)[None])[0]
        return np.cross(self.axis, moved - self.pivot)

    def with_pivot(self, point: ArrayLike) -> Revolute:
        """The same hinge with its pivot at the point of the axis nearest to `point` (3,) m, with uncertainty.

        A tilt (t1, t2) in the basis shifts the axis, d metres along it, by d (t2, -t1).
        """
        pivot = geo.nearest_point_on_line(point, self.pivot, self.axis)
        moved = replace(self, pivot=pivot)
        if self.covariance is None:
            return moved
        d = float((pivot - self.pivot) @ self.axis)
        jacobian = np.eye(4)
        jacobian[2:, :2] = d * np.array([[0.0, 1.0], [-1.0, 0.0]])
        covariance = jacobian @ self.covariance @ jacobian.T
        covariance = 0.5 * (covariance + covariance.T)
        sigma = None if self.sigma is None else JointSigma.of(covariance, self.sigma.state)
        return replace(moved, covariance=covariance, sigma=sigma)

    def _place(self) -> Array:
        return self.pivot

    def _at(self, axis: Array, pivot: Array, carried: Array) -> Self:
        return replace(self, axis=axis, pivot=pivot, covariance=self._carried(axis, carried))
