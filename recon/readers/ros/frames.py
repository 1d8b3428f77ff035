"""ROS's frames: where a bag's cameras stand to each other, and where the colour camera was in the world.

A transform of frame b in frame a is T_a_b, as tf2 tells it with a as header.frame_id and b as child_frame_id.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from recon.readers import files
from recon.readers.ros.bags import TRANSFORMS
from recon.readers.ros.choice import REALSENSE, Camera
from recon.readers.ros.topics import Bag, Topic
from twin.errors import InputError
from twin.geometry import Array, invert_pose, is_rotation, make_pose

_TF_TYPES = (TRANSFORMS, "tf/msg/tfMessage")  # the same bytes
_STILL = 1e-6  # m and of a rotation's entries: a transform that changes by less is static; chosen by us
_FAR = 1e9  # m, chosen by us: further than any frame on Earth from its planet's
_SAMPLED = 200  # messages of /tf that are looked at for static transforms; chosen by us
# messages of /tf that are read for poses; chosen by us: two minutes of a robot with a hundred joints at 10 Hz
_MOST = 200_000
_WORLDS = ("map", "odom", "world")  # REP 105's fixed frames
_REFERENCE = re.compile(r"/tf/(?:ref_)?(\d+)$")


@dataclass
class Frames:
    """Transforms between frames: T_parent_child by (parent, child)."""

    edges: dict[tuple[str, str], Array] = field(default_factory=dict)

    def add(self, parent: str, child: str, T_parent_child: Array) -> None:
        self.edges[parent.lstrip("/"), child.lstrip("/")] = T_parent_child

    def between(self, a: str, b: str) -> Array | None:
        """T_a_b by a chain of transforms in either direction; None without one."""
        chain = _chain(self.edges, a, b)
        if chain is None:
            return None
        T = np.eye(4)
        for parent, child in chain:
            edge = self.edges.get((parent, child))
            T = T @ (edge if edge is not None else invert_pose(self.edges[child, parent]))
        return T


def _chain(edges: Any, a: str, b: str) -> list[tuple[str, str]] | None:
    """Steps from frame a to frame b over known transforms."""
    near: dict[str, list[str]] = defaultdict(list)
    for parent, child in edges:
        near[parent].append(child)
        near[child].append(parent)
    came: dict[str, str] = {a: a}
    queue = [a]
    for frame in queue:
        for other in near[frame]:
            if other not in came:
                came[other] = frame
                queue.append(other)
    if b not in came:
        return None
    steps = []
    while b != a:
        steps.append((came[b], b))
        b = came[b]
    return steps[::-1]


def static_frames(bag: Bag, color: Camera, depth: Camera) -> Frames:
    """Transforms that don't change: /tf_static, RealSense's own, and constant ones of /tf if needed."""
    frames = Frames()
    for topic in _tf_topics(bag, static=True):
        for parent, child, T, _, _ in _transforms(bag, topic, range(len(topic.times))):
            frames.add(parent, child, T)
    for camera in (color, depth):
        _add_realsense(bag, camera, frames)
    if frames.between(color.frame, depth.frame) is None:
        _add_still(bag, frames)
    return frames


def _tf_topics(bag: Bag, static: bool) -> list[Topic]:
    return [t for t in bag.of_type(*_TF_TYPES) if t.name.endswith("tf_static") == static]


def _transforms(bag: Bag, topic: Topic, indices: Sequence[int]) -> Iterator[tuple[str, str, Array, int, int]]:
    """Parent, child, T_parent_child, stamp and log time (ns) of every transform in these messages."""
    for k, raw in zip(indices, topic.many(indices, None), strict=True):
        for item in bag.decoded(topic, raw, TRANSFORMS).transforms:
            stamp = int(item.header.stamp.sec) * 10**9 + int(item.header.stamp.nanosec)
            parent, child = (str(n).lstrip("/") for n in (item.header.frame_id, item.child_frame_id))
            t, q = item.transform.translation, item.transform.rotation
            T = _pose(f"{bag.shown}: {topic.name} from {parent} to {child},", t, q)
            yield parent, child, T, stamp, int(topic.times[k])


def _pose(name: str, t: Any, q: Any) -> Array:
    if not all(abs(v) < _FAR for v in (t.x, t.y, t.z, q.x, q.y, q.z, q.w)):
        raise InputError(f"{name} is not finite or further than {_FAR:.0g} m", "record again")
    translation = np.array([[t.x, t.y, t.z]], dtype=np.float64)
    return files.poses_from_xyzw(translation, np.array([[q.x, q.y, q.z, q.w]], dtype=np.float64), name, [0])[
        0
    ]


def _add_realsense(bag: Bag, camera: Camera, frames: Frames) -> None:
    """RealSense writes T_stream_reference of every stream, as a transform (ROS 1) or as text (ROS 2)."""
    stream = REALSENSE.match(camera.name)
    if stream is None:
        return
    for topic in bag.of_type("geometry_msgs/msg/Transform", "std_msgs/msg/String"):
        group = _REFERENCE.search(topic.name)
        if group is None or not topic.name.startswith(stream[0] + "/tf/"):
            continue
        message = bag.message(topic, 0)
        name = f"{bag.shown}: {topic.name}"
        T = (
            _from_text(name, str(message.data))
            if topic.type.endswith("String")
            else _pose(name, message.translation, message.rotation)
        )
        frames.add(stream[0], f"reference {group[1]} of {stream[0].split('/')[1]}", T)


def _from_text(name: str, text: str) -> Array:
    """rotation=<9 numbers, column by column>;translation=<3 numbers>."""
    said = dict(piece.partition("=")[::2] for piece in text.split(";"))
    try:
        rotation = np.array([float(v) for v in said["rotation"].split(",")]).reshape(3, 3).T
        translation = np.array([float(v) for v in said["translation"].split(",")]).reshape(3)
    except (KeyError, ValueError):
        raise InputError(
            f"{name} is no transform: {text[:80]!r}", "record again, or give --calibration"
        ) from None
    if not is_rotation(rotation, 1e-4) or not np.all(np.isfinite(translation)):
        raise InputError(f"{name} is no rotation: {text[:80]!r}", "record again, or give --calibration")
    return make_pose(rotation, translation)


def _add_still(bag: Bag, frames: Frames) -> None:
    """Transforms of /tf that have one value in all messages looked at, as ROS 1's static publishers do."""
    seen: dict[tuple[str, str], list[Array]] = defaultdict(list)
    for topic in _tf_topics(bag, static=False):
        count = min(len(topic.times), _SAMPLED)
        indices = np.unique(np.linspace(0, len(topic.times) - 1, count).astype(int)).tolist()
        for parent, child, T, _, _ in _transforms(bag, topic, indices):
            seen[parent, child].append(T)
    for (parent, child), values in seen.items():
        if _is_still(values):
            frames.add(parent, child, values[0])


def _is_still(values: list[Array]) -> bool:
    return bool(np.ptp(np.stack(values), axis=0).max() < _STILL)


def camera_poses(
    bag: Bag, frames: Frames, frame: str, count: int, by_log: bool
) -> tuple[tuple[Array, Array] | None, str]:
    """Times (k,) s and T_world_cam (k, 4, 4) of a camera frame by the bag's odometry or /tf; a note if none.

    Only where one source gives them and its body's transform to the camera is known. count: pictures, four
    times which are enough. by_log: whether the recording's clock is the log's.
    """
    odometry = bag.of_type("nav_msgs/msg/Odometry")
    if len(odometry) > 1:
        names = ", ".join(t.name for t in odometry)
        return None, f"{bag.path.name}: its poses are left out: there are several odometries ({names})"
    try:
        if odometry:
            return _from_odometry(bag, odometry[0], frames, frame, count, by_log)
        return _from_tf(bag, frames, frame, by_log)
    except InputError as error:
        return None, f"{bag.path.name}: its poses are left out: {error.problem}"


def _from_odometry(
    bag: Bag, topic: Topic, frames: Frames, frame: str, count: int, by_log: bool
) -> tuple[tuple[Array, Array] | None, str]:
    first = bag.message(topic, 0)
    body = str(first.child_frame_id).lstrip("/")
    T_body_cam = frames.between(body, frame) if body and frame else None
    if T_body_cam is None:
        why = f"{topic.name} is of {body or 'an unnamed body'}, whose transform to {frame or 'the camera'} is not known"
        return None, f"{bag.path.name}: its poses are left out: {why}"
    indices = range(0, len(topic.times), max(1, len(topic.times) // (4 * count)))
    times, poses = [], []
    for k, raw in zip(indices, topic.many(indices, None), strict=True):
        message = bag.decoded(topic, raw)
        stamp = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
        times.append(int(topic.times[k]) if by_log else stamp)
        p = message.pose.pose
        poses.append(_pose(f"{bag.shown}: {topic.name}", p.position, p.orientation) @ T_body_cam)
    return (np.array(times) * 1e-9, np.stack(poses)), ""


def _from_tf(bag: Bag, frames: Frames, frame: str, by_log: bool) -> tuple[tuple[Array, Array] | None, str]:
    topics = _tf_topics(bag, static=False)
    if not topics or not frame or sum(len(t.times) for t in topics) > _MOST:
        return None, ""
    moving: dict[tuple[str, str], list[tuple[int, Array]]] = defaultdict(list)
    for topic in topics:
        for parent, child, T, stamp, log in _transforms(bag, topic, range(len(topic.times))):
            if (parent, child) not in frames.edges:
                moving[parent, child].append((log if by_log else stamp, T))
    for edge in [e for e, found in moving.items() if _is_still([T for _, T in found])]:
        frames.add(*edge, moving.pop(edge)[0][1])
    for world in _WORLDS:
        chain = _chain([*frames.edges, *moving], world, frame)
        steps = [s for s in chain or () if s in moving or s[::-1] in moving]
        if len(steps) == 1 and steps[0] in moving:
            parent, child = steps[0]
            before, after = frames.between(world, parent), frames.between(child, frame)
            if before is not None and after is not None:
                times = np.array([t for t, _ in moving[parent, child]]) * 1e-9
                return (times, np.stack([before @ T @ after for _, T in moving[parent, child]])), ""
    return None, ""
