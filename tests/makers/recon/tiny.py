"""A tiny recording with exact truth, ray-cast in closed form: a room corner with a door and a drawer, and a
hand."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from recon.evaluation.metrics import DistanceField
from recon.evaluation.truth import Truth
from twin import geometry as geo
from twin.files.ply import ply_bytes
from twin.geometry import Array
from twin.scene import (
    HAND_LABEL,
    STATIC_LABEL,
    Box,
    ContactPath,
    Joint,
    Mesh,
    Motion,
    Part,
    Prismatic,
    Revolute,
    StaticPart,
    Twin,
)

WIDTH, HEIGHT, FOCAL = 96, 72, 80.0
FRAMES = 30
_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def box(centre: tuple[float, float, float], size: tuple[float, float, float]) -> Mesh:
    """A closed box, m."""
    return Mesh(Box(geo.make_pose(translation=centre), np.array(size)).corners, _FACES)


def merged(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    faces = [m.faces + o for m, o in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


STATIC = merged(box((0, 0.65, 1.2), (2.4, 0.1, 2.4)), box((0, -0.2, -0.05), (2.4, 2.4, 0.1)))
DOOR = merged(box((-0.3, 0.56, 1.3), (0.4, 0.02, 0.5)), box((-0.15, 0.53, 1.3), (0.02, 0.04, 0.1)))
DRAWER = merged(box((0.35, 0.5, 1.0), (0.4, 0.2, 0.2)), box((0.35, 0.38, 1.0), (0.1, 0.04, 0.02)))
JOINTS: dict[str, tuple[Joint, Mesh, Array]] = {
    # a door that opens towards the camera has its axis down when hinged on the left
    "door": (Revolute(np.array([0.0, 0, -1.0]), 0.0, 1.6, pivot=np.array([-0.5, 0.56, 1.0])), DOOR, np.array([-0.15, 0.52, 1.3])),
    "drawer": (Prismatic(np.array([0.0, -1.0, 0]), 0.0, 0.4), DRAWER, np.array([0.35, 0.36, 1.0])),
}  # fmt: skip
TRAVEL = {"door": 1.2, "drawer": 0.3}


def smooth(n: int, first: int, last: int) -> Array:
    """Minimum-jerk course (n,) from 0 at frame `first` to 1 at frame `last`."""
    u = np.clip((np.arange(n) - first) / (last - first), 0.0, 1.0)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u**2))


def cameras(n: int) -> Array:
    """Poses T_world_cam (n, 4, 4) of a head that sways in front of the scene."""
    k = np.arange(n) / 10.0
    centres = np.stack([0.05 * np.sin(k), -0.8 + 0.03 * np.cos(k), 1.25 + 0.02 * np.sin(2 * k)], axis=1)
    poses = np.tile(np.eye(4), (n, 1, 1))
    for i, c in enumerate(centres):
        z = geo.unit(np.array([0.0, 0.56, 1.15]) - c)
        x = geo.unit(np.cross(z, [0.0, 0.0, 1.0]))
        poses[i, :3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        poses[i, :3, 3] = c
    return poses


def write_recording(
    folder: Path,
    parts: tuple[str, ...] = ("door",),
    frames: int = FRAMES,
    scale: int = 1,
    still: bool = False,
    pattern: float = 15.0,
) -> Path:
    """Write a recording in the native layout with truth/ in it; the parts move one after the other.

    scale: 2 is 192x144. still: nothing moves but the camera. pattern: cells of the grey pattern per metre.
    """
    for name, data in _files(parts, frames, scale, still, pattern).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


@lru_cache(maxsize=8)  # many tests change a copy of the same clip
def _files(
    parts: tuple[str, ...], frames: int, scale: int, still: bool, pattern: float
) -> Mapping[str, bytes]:
    """Content of each file of a recording, by its name in the folder."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        _write(folder, parts, frames, scale, still, pattern)
        return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def _write(
    folder: Path, parts: tuple[str, ...], frames: int, scale: int, still: bool, pattern: float
) -> None:
    for name in ("color", "depth", "truth/labels"):
        (folder / name).mkdir(parents=True)
    T_world_cam = cameras(frames)
    slot = frames // len(parts)
    segments = {p: (k * slot + slot // 4, k * slot + (3 * slot) // 4) for k, p in enumerate(parts)}
    states = {p: (0.0 if still else TRAVEL[p]) * smooth(frames, *segments[p]) for p in parts}
    for i in range(frames):
        bodies = _bodies({p: states[p][i] for p in parts}, () if still else _holding(i, segments))
        _write_frame(folder, i, T_world_cam[i], bodies, scale, pattern)
    times = 5.0 + np.arange(frames) / 15.0
    (folder / "timestamps.txt").write_text("".join(f"{t:.6f}\n" for t in times))
    write_intrinsics(folder / "intrinsic.json", scale * WIDTH, scale * HEIGHT, scale * FOCAL)
    write_poses(folder / "truth" / "trajectory.txt", times, T_world_cam)
    _write_truth(folder / "truth", parts, segments, states)


def write_intrinsics(path: Path, width: int, height: int, focal: float) -> None:
    """Open3D's column-major intrinsics with the principal point in the middle."""
    matrix = [focal, 0, 0, 0, focal, 0, (width - 1) / 2, (height - 1) / 2, 1]
    path.write_text(json.dumps({"width": width, "height": height, "intrinsic_matrix": matrix}))


def write_poses(path: Path, times: Array, T_world_cam: Array) -> None:
    """TUM lines."""
    q = geo.quat_wxyz_from_matrix(T_world_cam[:, :3, :3])
    rows = np.column_stack([times, T_world_cam[:, :3, 3], q[:, [1, 2, 3, 0]]])
    path.write_text("".join(" ".join(f"{v:.12f}" for v in row) + "\n" for row in rows))


def read_image(path: Path) -> NDArray[Any]:
    """An image as it is stored."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


def _hand_mesh(grip: Array) -> Mesh:
    x, y, z = grip
    return box((x, y - 0.02, z), (0.14, 0.10, 0.14))


def _holding(index: int, segments: dict[str, tuple[int, int]]) -> tuple[str, ...]:
    """Parts that the hand holds."""
    return tuple(p for p, (a, b) in segments.items() if a - 2 <= index <= b + 2)


def _bodies(states: dict[str, float], held: tuple[str, ...]) -> list[tuple[int, Mesh, Array]]:
    """Label, mesh at state 0 and pose of everything in one frame."""
    bodies = [(STATIC_LABEL, STATIC, np.eye(4))]
    for k, (p, state) in enumerate(states.items()):
        joint, mesh, grip = JOINTS[p]
        bodies.append((k + 2, mesh, joint.pose(state)))
        if p in held:
            bodies.append((HAND_LABEL, _hand_mesh(grip), joint.pose(state)))
    return bodies


def _write_frame(
    folder: Path,
    index: int,
    T_world_cam: Array,
    bodies: list[tuple[int, Mesh, Array]],
    scale: int,
    pattern: float,
) -> None:
    width, height, focal = scale * WIDTH, scale * HEIGHT, scale * FOCAL
    scene = o3d.t.geometry.RaycastingScene()
    label_of = []
    for label, rest, T in bodies:
        mesh = rest.transformed(T)
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
        )
        label_of.append(label)
    y, x = np.mgrid[0:height, 0:width]
    rays = np.stack([(x - (width - 1) / 2) / focal, (y - (height - 1) / 2) / focal, np.ones(x.shape)], -1)
    directions = geo.rotate(T_world_cam, rays)
    origin = np.broadcast_to(T_world_cam[:3, 3], directions.shape)
    hit = scene.cast_rays(
        o3d.core.Tensor.from_numpy(np.concatenate([origin, directions], -1).astype(np.float32))
    )
    depth = hit["t_hit"].numpy()  # rays have z = 1 in the camera, so that t is the depth
    ids = hit["geometry_ids"].numpy()
    seen = np.isfinite(depth)
    labels = np.where(seen, np.array([*label_of, 0])[np.where(seen, ids, len(label_of))], 0).astype(np.uint8)
    points = origin + directions * np.where(seen, depth, 0.0)[..., None]
    for k, (label, _, T) in enumerate(bodies):  # the pattern moves with its body
        if label != STATIC_LABEL:
            points[ids == k] = geo.transform(geo.invert_pose(T), points[ids == k])
    cx, cy, cz = np.moveaxis(np.floor(points * pattern + 0.37).astype(np.int64), -1, 0)  # no face on a border
    checks = (cx * 73856093 + cy * 19349663 + cz * 83492791) % 101
    grey = np.array([40, 90, 150])[labels % 3] + checks
    color = np.repeat(grey.astype(np.uint8)[..., None], 3, -1)
    millimetres = np.where(seen, np.rint(depth * 1000), 0).astype(np.uint16)
    name = f"{index:06d}"
    cv2.imwrite(str(folder / "color" / f"{name}.jpg"), color)
    cv2.imwrite(str(folder / "depth" / f"{name}.png"), millimetres)
    cv2.imwrite(str(folder / "truth" / "labels" / f"{name}.png"), labels)


def _write_truth(
    folder: Path, parts: tuple[str, ...], segments: dict[str, tuple[int, int]], states: dict[str, Array]
) -> None:
    n = len(next(iter(states.values())))
    entries, poses = [], {}
    owner: list[int | None] = [None] * n
    point: list[list[float] | None] = [None] * n
    for k, p in enumerate(parts):
        joint, mesh, grip = JOINTS[p]
        poses[f"part_{k + 2}"] = joint.poses(states[p])
        pivot = joint.pivot.tolist() if isinstance(joint, Revolute) else [0.0, 0.0, 0.0]
        entry: dict[str, Any] = {
            "id": k + 2, "name": p, "type": joint.kind, "axis_world": joint.axis.tolist(), "pivot_world": pivot,
            "range": [0.0, joint.upper], "states": states[p].tolist(), "interval": list(segments[p]),
            "motion_segments": [list(segments[p])],
        }  # fmt: skip
        entries.append(entry)
        (folder / f"part_{k + 2}.ply").write_bytes(ply_bytes(mesh))
        for i in range(n):
            if p in _holding(i, segments):
                owner[i], point[i] = k + 2, geo.transform(joint.pose(states[p][i]), grip[None])[0].tolist()
    hand = {"contact": [o is not None for o in owner], "contact_part": owner, "contact_point_world": point}
    data = {"world": "z-up, metres", "frames": n, "fps": 15, "parts": entries, "hand": hand}
    (folder / "truth.json").write_text(json.dumps(data))
    (folder / "static.ply").write_bytes(ply_bytes(STATIC))
    np.savez(folder / "part_poses.npz", **poses)  # type: ignore[arg-type]
    np.savez(folder / "hand_keypoints.npz", keypoints_world=np.arange(n * 63.0).reshape(n, 21, 3))


def twin_of(truth: Truth) -> Twin:
    """The twin that is exactly the truth."""
    parts = []
    for p in truth.parts:
        pivot = {"pivot": p.joint.pivot} if isinstance(p.joint, Revolute) else {}
        joint = type(p.joint)(p.joint.axis, 0.0, p.travel, **pivot)  # type: ignore[arg-type]
        motion = Motion(np.arange(truth.frames), truth.cameras.times, p.states - p.closed, p.spans)
        contact = ContactPath(
            DistanceField(p.closed_mesh).nearest(p.handle[None])[0], np.eye(3), 0.02, (0,), "truth"
        )
        parts.append(Part(p.id, p.name, p.closed_mesh, joint, motion, contact=contact))
    static = StaticPart("static", truth.static)
    return Twin("scene", static, tuple(parts), cameras=truth.cameras, labels=truth.labels)


def in_world(twin: Twin, T: Array) -> Twin:
    """The same twin in another world frame."""
    parts = []
    for p in twin.parts:
        contact = p.contact and replace(p.contact, point=geo.transform(T, p.contact.point[None])[0])
        joint = replace(p.joint.transformed(T), lower=p.joint.lower, upper=p.joint.upper)
        parts.append(replace(p, mesh=p.mesh.transformed(T), joint=joint, contact=contact))
    static = replace(twin.static, mesh=twin.static.mesh.transformed(T))
    assert twin.cameras is not None
    return replace(twin, static=static, parts=tuple(parts), cameras=twin.cameras.transformed(T))
