"""Numbers that say where they come from: quantities with source and interval; a part's mass and friction.

Numpy only; every type checks its own laws when it is built.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from twin.describe import line
from twin.errors import SceneError
from twin.geometry import Array

Origin = Literal["measured", "geometry", "vlm", "recording", "user", "typical", "default", "other"]
ORIGINS: tuple[Origin, ...] = get_args(Origin)
# Chosen by us: beyond it a double can't tell tenths of a millimetre, and computations overflow soon.
LARGEST = 1e12


class Described:
    """A scene type that shows itself in one short line, see twin.describe."""

    def __repr__(self) -> str:
        return line(self)


def frozen_array(
    values: Any, shape: tuple[int | None, ...], what: str, dtype: Any = np.float64
) -> NDArray[Any]:
    """Read-only copy of a checked shape (None = any length) and finite values; frozen arrays are returned."""
    a = values if _is_frozen(values, dtype) else np.array(values, dtype=dtype)
    if a.ndim != len(shape) or any(s is not None and s != n for s, n in zip(shape, a.shape, strict=True)):
        raise SceneError(f"{what} must have shape {shape}, got {a.shape}")
    if a.dtype.kind == "f" and not np.all(np.isfinite(a)):
        raise SceneError(
            f"{what} holds values that are not finite", "drop or repair them before building the type"
        )
    if a.dtype.kind == "f" and a.size:
        require_sane(float(a.flat[int(np.argmax(np.abs(a)))]), f"the largest of {what}")
    a.flags.writeable = False
    return a


def _is_frozen(values: Any, dtype: Any) -> bool:
    """Whether nobody can change an array, through itself or another."""
    if not isinstance(values, np.ndarray) or values.dtype != np.dtype(dtype):
        return False
    return values.flags.owndata and not values.flags.writeable


def set_field(instance: object, name: str, value: Any) -> None:
    """Set a field of a frozen dataclass, for use while it is built."""
    object.__setattr__(instance, name, value)


def origin_of(source: str) -> Origin:
    """The leading word of a source text, "word: detail": measured (weighed, timed), geometry (surface x
    table), vlm (a vision-language model's answer), recording (what the recording shows asks for it), user
    (stated by the user), typical (measured on other furniture and asked for by the user), default (from a
    table); other for any other text."""
    word = source.partition(":")[0].strip()
    return next((known for known in ORIGINS if known == word), "other")


@dataclass(frozen=True)
class Quantity:
    """A number with its interval (low, high) and where it comes from: "word: detail", see `origin_of`."""

    value: float
    source: str
    interval: tuple[float, float]

    def __post_init__(self) -> None:
        low, high = self.interval
        if not (
            np.isfinite(self.value) and np.isfinite(low) and np.isfinite(high) and low <= self.value <= high
        ):
            raise SceneError(
                f"a quantity must lie inside its finite interval, got {self.value} in {self.interval}"
            )
        require_sane(self.value, "a quantity")
        _require_source(self.source)

    @property
    def origin(self) -> Origin:
        """Where the number comes from, in one word."""
        return origin_of(self.source)


@dataclass(frozen=True, eq=False, repr=False)
class Inertial(Described):
    """Mass (kg) with interval and source, centre of mass (3,) m and inertia tensor (3, 3) kg m^2 about it.

    World axes at state 0. The tensor is positive definite and its moments obey the triangle inequality.

    inertia_source: where centre and tensor come from; the mass' source when left out. inertia_interval: (low,
    high) factors: the true tensor's moment about any axis through its centre lies between low and high times
    this one's, the uncertainty of the mass included. com_interval: (2, 3) m, lower and upper corner of the
    box the true centre lies in. Both are None where nobody stated them.
    """

    mass: Quantity
    com: Array
    inertia: Array
    inertia_source: str = ""
    inertia_interval: tuple[float, float] | None = None
    com_interval: Array | None = None

    def __post_init__(self) -> None:
        set_field(self, "com", frozen_array(self.com, (3,), "centre of mass"))
        set_field(self, "inertia", frozen_array(self.inertia, (3, 3), "inertia tensor"))
        set_field(self, "inertia_source", self.inertia_source or self.mass.source)
        _require_source(self.inertia_source)
        if self.mass.value <= 0:
            raise SceneError(f"mass must be positive, got {self.mass.value} kg")
        if not np.allclose(self.inertia, self.inertia.T, rtol=1e-9, atol=1e-15):
            raise SceneError("inertia tensor must be symmetric")
        moments = np.linalg.eigvalsh(self.inertia)
        if moments[0] <= 0:
            raise SceneError(
                f"inertia must be positive definite, its principal moments are {moments.tolist()}"
            )
        if moments[2] > (moments[0] + moments[1]) * (1 + 1e-6):
            raise SceneError(f"principal moments {moments.tolist()} break the triangle inequality")
        self._check_intervals()

    def _check_intervals(self) -> None:
        if self.inertia_interval is not None:
            low, high = (float(v) for v in self.inertia_interval)
            if not (np.isfinite(high) and 0 <= low <= 1 <= high):
                raise SceneError(f"inertia interval must be factors around 1, got {self.inertia_interval}")
            set_field(self, "inertia_interval", (low, high))
        if self.com_interval is not None:
            set_field(
                self,
                "com_interval",
                frozen_array(self.com_interval, (2, 3), "interval of the centre of mass"),
            )
            if np.any(self.com_interval[0] > self.com) or np.any(self.com_interval[1] < self.com):
                raise SceneError("centre of mass must lie inside its interval")

    def with_mass(self, mass: Quantity) -> Inertial:
        """The same distribution of another mass: the tensor grows with it, and so does its interval.

        How the mass is spread stays as uncertain: the interval's factors keep their ratio to the mass's.
        """
        was, interval = self.mass, self.inertia_interval
        if interval is not None:
            thin = interval[0] * was.value / was.interval[0] if was.interval[0] > 0 else 0.0
            wide = interval[1] * was.value / was.interval[1]
            share = [m / mass.value for m in mass.interval]
            interval = (min(1.0, thin * share[0]), max(1.0, wide * share[1]))
        scaled = self.inertia * (mass.value / was.value)
        return replace(self, mass=mass, inertia=scaled, inertia_interval=interval)


@dataclass(frozen=True)
class Catch:
    """What holds a closed part beside friction: a magnet, a roller, a seal. It pulls a part shut with the
    same force all over its width, and not at all beyond.

    Attributes:
        force: along the joint, N or N m, without friction.
        width: from the closed state, m or rad.
    """

    force: Quantity
    width: Quantity

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name).value
            if value <= 0:
                raise SceneError(f"the {f.name} of a catch must be positive, got {value:g}")

    def pull(self, state: float) -> float:
        """Force (N or N m) with which it holds a part at a state (m or rad) against being opened."""
        return self.force.value if state < self.width.value else 0.0


@dataclass(frozen=True, repr=False)
class PartPhysics(Described):
    """Contact and joint physics: sliding friction (-), joint damping (N s/m or N m s/rad), joint frictionloss
    (N or N m), material density (kg/m^3), and the catch of the closed part, None where nobody asked for
    one."""

    friction: Quantity
    damping: Quantity
    frictionloss: Quantity
    density: Quantity
    catch: Catch | None = None

    def __post_init__(self) -> None:
        for name, quantity in self.numbers.items():
            if quantity.value < 0:
                raise SceneError(f"{name} must not be negative, got {quantity.value:g}")

    @property
    def numbers(self) -> dict[str, Quantity]:
        """The quantities that every part has, by their names."""
        return {k: v for k, v in vars(self).items() if isinstance(v, Quantity)}

    def but(self, values: Mapping[str, Quantity]) -> PartPhysics:
        """The same with some of its numbers replaced, by their names."""
        replaced: dict[str, Any] = {**vars(self), **values}
        return PartPhysics(**replaced)

    def caught(self, state: float) -> float:
        """Force (N or N m) with which a catch holds the part at a state (m or rad); 0 without a catch."""
        return 0.0 if self.catch is None else self.catch.pull(state)


def require_sane(value: float, what: str) -> None:
    """Raises SceneError for a number that nothing real has."""
    if abs(value) > LARGEST:
        raise SceneError(f"{what} is {value:g}, which is beyond {LARGEST:g}", "check the unit and the file")


def _require_source(source: str) -> None:
    if not source.strip() or not source.isprintable():
        raise SceneError(f"a source must be one line of text, got {source!r}", "say where the number is from")
