"""The types of a functional digital twin. Numpy only; every type checks its own laws when it is built.

World frame: z up, gravity-aligned, metres. Meshes, hulls, axes, pivots, contacts and inertias are stored in
the world frame with every joint at state 0, the most closed state; opening is positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.describe import html
from twin.errors import SceneError, nearest_name
from twin.geometry import Array
from twin.inferred import Completion as Completion
from twin.joint import Joint as Joint
from twin.joint import JointSigma as JointSigma
from twin.joint import Prismatic as Prismatic
from twin.joint import Revolute as Revolute
from twin.names import require_legal
from twin.quantities import ORIGINS as ORIGINS
from twin.quantities import Catch as Catch
from twin.quantities import Described as Described
from twin.quantities import Inertial as Inertial
from twin.quantities import Origin as Origin
from twin.quantities import PartPhysics as PartPhysics
from twin.quantities import Quantity as Quantity
from twin.quantities import frozen_array as _frozen
from twin.quantities import origin_of as origin_of
from twin.quantities import set_field as _set
from twin.shapes import Box as Box
from twin.shapes import Collision as Collision
from twin.shapes import Mesh as Mesh
from twin.shapes import Texture as Texture
from twin.verdict import Verdict

STATIC_LABEL = 1
HAND_LABEL = 255
UNKNOWN_LABEL = 0
FIRST_PART_ID = 2


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Described):
    """Measured motion of a part: `state` (n,) m or rad at recording `frames` (n,) and `times` (n,) s.

    intervals: first and last moving frame of each interaction, inclusive. residual: RMS of the fit in metres.
    inliers: share of the evidence that agrees, 0..1.
    """

    frames: NDArray[np.int64]
    times: Array
    state: Array
    intervals: tuple[tuple[int, int], ...] = ()
    residual: float = 0.0
    inliers: float = 1.0

    def __post_init__(self) -> None:
        _set(self, "frames", _frozen(self.frames, (None,), "motion frames", np.int64))
        n = len(self.frames)
        _set(self, "times", _frozen(self.times, (n,), "motion times"))
        _set(self, "state", _frozen(self.state, (n,), "motion state"))
        if n and np.any(np.diff(self.frames) <= 0):
            raise SceneError("motion frames must strictly increase")
        if any(a >= b for a, b in self.intervals):
            raise SceneError(f"an interval must have first < last, got {self.intervals}")


@dataclass(frozen=True, eq=False, repr=False)
class ContactPath(Described):
    """Where the hand held the part.

    point: (3,) m on the part's surface, world frame at state 0. rotation: (3, 3), columns = direction in
    which the hand closes, direction along the handle, direction out of the part (right-handed). width: m,
    thickness held along the closing direction. frames: recording frames in which the hand holds the part.
    """

    point: Array
    rotation: Array
    width: float
    frames: tuple[int, ...]
    source: str

    def __post_init__(self) -> None:
        _set(self, "point", _frozen(self.point, (3,), "contact point"))
        _set(self, "rotation", _frozen(self.rotation, (3, 3), "contact rotation"))
        if not geo.is_rotation(self.rotation):
            raise SceneError("contact rotation must be a right-handed rotation matrix")
        if not (np.isfinite(self.width) and self.width >= 0):
            raise SceneError(f"contact width must be finite and not negative, got {self.width}")


@dataclass(frozen=True, eq=False, repr=False)
class HandleSection(Described):
    """How thick a part's handle is, by its outline in photographs.

    middle: (3,) m of its outer face, world frame at state 0. width: m across its length. photographs: number.
    """

    middle: Array
    width: float
    photographs: int

    def __post_init__(self) -> None:
        _set(self, "middle", _frozen(self.middle, (3,), "middle of a handle"))
        if not (np.isfinite(self.width) and self.width > 0):
            raise SceneError(f"a handle's width must be finite and positive, got {self.width}")
        if self.photographs < 1:
            raise SceneError(f"a handle's width needs a photograph, got {self.photographs}")


@dataclass(frozen=True, eq=False, repr=False)
class StaticPart(Described):
    """Everything that never moves. completion: its inferred layer, None where nobody inferred one."""

    name: str
    mesh: Mesh
    collision: tuple[Collision, ...] = ()
    completion: Completion | None = None

    def __post_init__(self) -> None:
        require_legal(self.name)


@dataclass(frozen=True, eq=False, repr=False)
class Part(Described):
    """A moving part. `parent` is the id of the part it is mounted on, None for the static scene.

    extra: what others wrote about it into twin.json, by key; JSON types. verdict: what it is worth; None of a
    stated part, or one older than verdicts. collision: shapes of what was seen. completion: the inferred
    layer, None where nobody inferred one. handle: None where no photograph tells how thick it is.
    """

    id: int
    name: str
    mesh: Mesh
    joint: Joint
    motion: Motion
    inertial: Inertial | None = None
    physics: PartPhysics | None = None
    contact: ContactPath | None = None
    collision: tuple[Collision, ...] = ()
    parent: int | None = None
    limits_source: str = "observed"
    closed_source: str = "first rest pose"
    type_source: str = "motion"
    extra: Mapping[str, Any] = field(default_factory=dict)
    verdict: Verdict | None = None
    completion: Completion | None = None
    handle: HandleSection | None = None

    def __post_init__(self) -> None:
        require_legal(self.name)
        if not FIRST_PART_ID <= self.id < HAND_LABEL:
            raise SceneError(f"part id must be in {FIRST_PART_ID}..{HAND_LABEL - 1}, got {self.id}")
        if type(self.joint) not in (Prismatic, Revolute):
            raise SceneError(
                f"part {self.name!r} needs a Prismatic or Revolute joint, got {type(self.joint).__name__}"
            )

    def _repr_html_(self) -> str:
        return html(self)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Described):
    """Camera poses T_world_cam (n, 4, 4) (OpenCV camera axes) at recording `frames` (n,), `times` (n,) s."""

    frames: NDArray[np.int64]
    times: Array
    T_world_cam: Array

    def __post_init__(self) -> None:
        _set(self, "frames", _frozen(self.frames, (None,), "trajectory frames", np.int64))
        n = len(self.frames)
        _set(self, "times", _frozen(self.times, (n,), "trajectory times"))
        _set(self, "T_world_cam", _frozen(self.T_world_cam, (n, 4, 4), "camera poses"))
        if n == 0:
            raise SceneError("a camera trajectory must not be empty")
        if np.any(np.diff(self.frames) <= 0) or np.any(np.diff(self.times) <= 0):
            raise SceneError("camera frames and times must strictly increase")
        if not geo.is_rotation(self.T_world_cam[:, :3, :3]):
            raise SceneError("camera poses must be rigid")

    def pose(self, frame: int) -> Array | None:
        """T_world_cam (4, 4) of a recording frame, None when that frame is lost."""
        k = int(np.searchsorted(self.frames, frame))
        return self.T_world_cam[k] if k < len(self.frames) and self.frames[k] == frame else None

    def gaps(self, count: int) -> tuple[tuple[int, int], ...]:
        """First and last frames of the stretches without a pose, of a recording of `count` frames."""
        lost = np.setdiff1d(np.arange(count), self.frames)
        if not len(lost):
            return ()
        ends = np.flatnonzero(np.diff(lost) > 1)
        starts, lasts = lost[np.append(0, ends + 1)], lost[np.append(ends, len(lost) - 1)]
        return tuple(zip(starts.tolist(), lasts.tolist(), strict=True))

    def transformed(self, T_new_world: Array) -> Trajectory:
        """The same cameras in another world frame."""
        return replace(self, T_world_cam=T_new_world @ self.T_world_cam)


@dataclass(frozen=True, eq=False, repr=False)
class Recorded(Described):
    """What the twin was made from: source path name, frame count and a fingerprint of the input."""

    source: str
    frames: int
    fingerprint: str


@dataclass(frozen=True, eq=False, repr=False)
class Twin(Described):
    """Static scene, moving parts (a tree), cameras and where it all comes from.

    labels: recording frame -> (H, W) uint8 label image (0 unknown, 1 static, part ids from 2, 255 hand); may
    be lazy. provenance: versions and configuration, JSON types only. extra: what others wrote into twin.json
    beside the format's own keys, JSON types; that of a part is with the part. verdict: what the whole is
    worth, None as of a part. filtered_pairs: pairs of names of parts, or of one and the static scene, that
    don't collide with each other in a simulation.
    """

    name: str
    static: StaticPart
    parts: tuple[Part, ...]
    cameras: Trajectory | None = None
    recorded: Recorded | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    labels: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)
    verdict: Verdict | None = None
    filtered_pairs: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        require_legal(self.name)
        names = [o.name for o in self.owners]
        if len({n.lower() for n in names}) != len(names):
            raise SceneError(f"part names must be unique whatever their case, got {names}")
        ids = [p.id for p in self.parts]
        if len(set(ids)) != len(ids):
            raise SceneError(f"part ids must be unique, got {ids}")
        for p in self.parts:
            self._check_ancestors(p)
        self._check_pairs(names)

    def _repr_html_(self) -> str:
        return html(self)

    @property
    def owners(self) -> tuple[StaticPart | Part, ...]:
        """The static scene, then the parts."""
        return (self.static, *self.parts)

    def _check_pairs(self, names: list[str]) -> None:
        for pair in self.filtered_pairs:
            if len(pair) != 2 or pair[0] == pair[1]:
                raise SceneError(f"a filtered pair must hold two different names, got {list(pair)}")
            for name in pair:
                if name not in names:
                    close = nearest_name(name, names)
                    hint = f"did you mean {close!r}?" if close else f"there are: {', '.join(names)}"
                    raise SceneError(
                        f"filtered_pairs names {name!r}, which is neither a part nor the static scene", hint
                    )
        kept = {tuple(sorted(pair, key=names.index)) for pair in self.filtered_pairs}
        _set(self, "filtered_pairs", tuple(sorted(kept, key=lambda pair: [names.index(n) for n in pair])))

    def _check_ancestors(self, part: Part) -> None:
        seen = {part.id}
        parent = part.parent
        while parent is not None:
            if parent in seen:
                raise SceneError(f"part {part.name!r} is its own ancestor", "parents must form a tree")
            seen.add(parent)
            parent = self.part(parent).parent

    def part(self, key: int | str) -> Part:
        """The part with this id or name. Raises SceneError that lists what exists."""
        for p in self.parts:
            if key in (p.id, p.name):
                return p
        known = ", ".join(f"{p.name} (id {p.id})" for p in self.parts) or "none"
        close = nearest_name(str(key), [p.name for p in self.parts])
        hint = f"did you mean {close!r}? " if close else ""
        raise SceneError(f"the twin has no part {key!r}", f"{hint}its parts are: {known}")

    def part_pose(self, key: int | str, states: Mapping[int, float]) -> Array:
        """T_world_part (4, 4) from state 0 of a part when every part id in `states` is at that state.

        The joint of a nested part is carried along by its parents.
        """
        part = self.part(key)
        pose = part.joint.pose(states.get(part.id, 0.0))
        return pose if part.parent is None else self.part_pose(part.parent, states) @ pose
