"""The truth beside a simulated recording: cameras, joints, states, meshes, labels and grip (docs/recordings.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.evaluation import metrics
from recon.evaluation.metrics import Span
from recon.readers import files
from recon.recording import Intrinsics
from twin import geometry as geo
from twin.errors import FuntwinError, InputError
from twin.files.ply import read_ply
from twin.geometry import Array
from twin.scene import Joint, Mesh, Prismatic, Revolute, Trajectory
from twin.storage.labels import LabelFolder


@dataclass(frozen=True, eq=False)
class TruthPart:
    """A part as it truly moved.

    joint, mesh, grip: world frame at state 0. states (n,) m or rad and T_world_part (n, 4, 4), which maps the mesh to
    the frame, for every frame. grip: centre of the hand's grip (3,), None when no hand held the part. segments: for
    every motion the last frame at rest before it and the first after it.
    """

    id: int
    name: str
    joint: Joint
    states: Array
    T_world_part: Array
    mesh: Mesh
    segments: tuple[Span, ...]
    grip: Array | None

    @property
    def closed(self) -> float:
        """The most closed state that the recording shows; a twin's state 0."""
        return float(self.states.min())

    @property
    def travel(self) -> float:
        """Range of states that the recording shows, m or rad."""
        return float(np.ptp(self.states))

    @property
    def spans(self) -> tuple[Span, ...]:
        """First and last moving frame of every motion."""
        found = (metrics.moving_span(self.states[a : b + 1], a) for a, b in self.segments)
        return tuple(s for s in found if s is not None)

    @property
    def span(self) -> Span | None:
        """First and last moving frame of all motions; None when the part never moves."""
        return metrics.span_hull(self.spans)

    @property
    def moving_frames(self) -> NDArray[np.int64]:
        """Frames inside `span`."""
        return np.arange(self.span[0], self.span[1] + 1) if self.span else np.zeros(0, dtype=np.int64)

    @property
    def T_world_closed(self) -> Array:
        """Pose (4, 4) that takes the mesh from state 0 to the most closed state shown."""
        return self.joint.pose(self.closed)

    @property
    def closed_mesh(self) -> Mesh:
        """The mesh at the most closed state shown."""
        return self.mesh.transformed(self.T_world_closed)

    @property
    def handle(self) -> Array:
        """Point (3,) at the most closed state shown that the hand leads: the grip, else the vertex that moves furthest."""
        point = self.grip
        if point is None:
            v = self.mesh.vertices
            moved = np.linalg.norm(geo.transform(self.joint.pose(max(self.travel, 1e-3)), v) - v, axis=1)
            point = v[int(np.argmax(moved))]
        return np.array(geo.transform(self.T_world_closed, point[None])[0])


@dataclass(frozen=True, eq=False)
class Truth:
    """Truth of one recording of `frames` frames; labels as in a twin, static: everything that never moves. intrinsics: where those of
    the recording are wrong on purpose.
    """

    folder: Path
    frames: int
    cameras: Trajectory
    parts: tuple[TruthPart, ...]
    labels: Mapping[int, NDArray[np.uint8]]
    static: Mesh
    intrinsics: Intrinsics | None = None

    def part(self, key: int) -> TruthPart:
        """The part with this id. Raises InputError that lists the ids."""
        for p in self.parts:
            if p.id == key:
                return p
        raise InputError(f"{self.folder} has no part {key}", f"its parts are {[p.id for p in self.parts]}")


def load_truth(folder: Path | str) -> Truth:
    """Read a folder truth/. Raises InputError naming the file and the value."""
    folder = Path(folder)
    if not (folder / "truth.json").is_file():
        inside = folder / "truth"
        if not (inside / "truth.json").is_file():
            raise InputError(
                f"{folder} holds no truth.json", "give the folder truth/ of a simulated recording"
            )
        folder = inside
    data = files.read_json(folder / "truth.json")
    try:
        frames = int(data["frames"])
        poses = _part_poses(folder, [int(p["id"]) for p in data["parts"]], frames)
        parts = tuple(_part(folder, p, data.get("hand") or {}, poses[int(p["id"])]) for p in data["parts"])
    except FuntwinError:
        raise
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"{files.shown(folder / 'truth.json')} lacks or garbles {error}",
            "write it anew with the simulator",
        ) from None
    stamps, cameras = files.read_tum_poses(folder / "trajectory.txt")
    if len(cameras) != frames:
        raise InputError(
            f"{files.shown(folder / 'trajectory.txt')} has {len(cameras)} poses for {frames} frames",
            "the truth has one pose a frame",
        )
    return Truth(
        folder=folder,
        frames=frames,
        cameras=Trajectory(np.arange(frames), stamps, cameras),
        parts=parts,
        labels=LabelFolder(folder / "labels"),
        static=read_ply(folder / "static.ply"),
        intrinsics=_intrinsics(folder / "intrinsic.json"),
    )


def _intrinsics(path: Path) -> Intrinsics | None:
    return files.read_intrinsics(path) if path.is_file() else None


def _part_poses(folder: Path, ids: list[int], frames: int) -> dict[int, Array]:
    path = folder / "part_poses.npz"
    try:
        with np.load(path, allow_pickle=False) as archive:
            poses = {k: np.asarray(archive[f"part_{k}"], dtype=np.float64) for k in ids}
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            f"{files.shown(path)} can't be read ({error})", "write it anew with the simulator"
        ) from None
    for k, T in poses.items():
        if T.shape != (frames, 4, 4):
            raise InputError(
                f"{files.shown(path)}: part_{k} has shape {T.shape}", f"expected ({frames}, 4, 4)"
            )
    return poses


def _part(folder: Path, entry: Mapping[str, Any], hand: Mapping[str, Any], T_world_part: Array) -> TruthPart:
    states = np.array(entry["states"], dtype=np.float64)
    if states.shape != (len(T_world_part),):
        raise InputError(
            f"{files.shown(folder / 'truth.json')} has {states.size} states of part {entry['id']} for "
            f"{len(T_world_part)} frames",
            "the truth has one state a frame",
        )
    axis = geo.unit(entry["axis_world"])
    limits = float(min(states.min(), 0.0)), float(max(states.max(), 0.0))
    joint: Joint
    if entry["type"] == "prismatic":
        joint = Prismatic(axis, *limits)
    else:
        joint = Revolute(axis, *limits, pivot=np.array(entry["pivot_world"], dtype=np.float64))
    segments = entry.get("motion_segments") or ([entry["interval"]] if entry.get("interval") else [])
    return TruthPart(
        id=int(entry["id"]),
        name=str(entry["name"]),
        joint=joint,
        states=states,
        T_world_part=T_world_part,
        mesh=read_ply(folder / f"part_{int(entry['id'])}.ply"),
        segments=tuple((int(a), int(b)) for a, b in segments),
        grip=_grip(int(entry["id"]), hand, T_world_part),
    )


def _grip(part: int, hand: Mapping[str, Any], T_world_part: Array) -> Array | None:
    """Median grip centre (3,) in the world at state 0, over the frames in which the hand holds the part."""
    points = hand.get("contact_point_world") or []
    owners = hand.get("contact_part") or [None] * len(points)
    held = [
        geo.transform(geo.invert_pose(T_world_part[k]), np.array([p], dtype=np.float64))[0]
        for k, (p, owner) in enumerate(zip(points, owners, strict=True))
        if p is not None and owner == part
    ]
    return np.median(held, axis=0) if held else None
