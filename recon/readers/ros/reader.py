"""ROS bags: .bag of ROS 1, .db3 and .mcap of ROS 2, and those of RealSense's recorder.

Types are ROS's own (sensor_msgs, geometry_msgs, tf2_msgs, nav_msgs); units and frames those of its REPs 103,
105 and 118. RealSense's topics are those of its library's record and playback. The header's stamp is the time
of a picture; the time at which it was logged comes later by what the network took.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.readers.fingerprint import fingerprint, fingerprint_of
from recon.readers.ros import images as ros_images
from recon.readers.ros.bags import is_bag, open_bag
from recon.readers.ros.cameras import depth_unit, lens_of
from recon.readers.ros.choice import Camera, chosen, lies_on
from recon.readers.ros.frames import Frames, camera_poses, static_frames
from recon.readers.ros.topics import HEAD, Bag, Topic, digest, guarded, one_line
from recon.readers.streams import Streams
from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array

_SAMPLES = 16  # messages whose stamps are compared with their log times before all are read; chosen by us
_STEADY = 10**6  # ns: stamps that differ from log times by one number within this are log times; chosen by us
_SAME = 1e-4  # px: cameras whose numbers differ by less are one; chosen by us, they are written as float32


@dataclass(frozen=True)
class RosReader:
    """Reads a bag. color_topic, depth_topic: names that go before what is found; calibrated: which of
    "color", "depth" (lenses) and "pose" (between them) replace the bag's own afterwards, so that the bag may
    lack them: what stands for them is of no meaning."""

    layout: str = "a ROS bag: .bag, .db3, .mcap, or a folder of ros2 bag record"
    color_topic: str | None = None
    depth_topic: str | None = None
    calibrated: frozenset[str] = frozenset()

    def recognises(self, path: Path) -> bool:
        return is_bag(path)

    def streams(self, path: Path) -> Streams:
        try:
            return self._streams(open_bag(path))
        except InputError as error:
            raise one_line(error) from None

    def _streams(self, bag: Bag) -> Streams:
        path = bag.path
        color, depth = chosen(bag, self.color_topic, self.depth_topic)
        frames = static_frames(bag, color, depth)
        rig = self._rig(bag, frames, color, depth)
        unit = depth_unit(bag, depth)
        clock, warnings = _clock(bag, color.topic, depth.topic)
        order = [np.unique(stamps, return_index=True) for stamps in clock.stamps]
        for camera, (stamps, _), name in zip((color, depth), order, ("colour", "depth"), strict=True):
            twice = len(camera.topic.times) - len(stamps)
            if twice:
                warnings += (f"{path.name}: {twice} {name} pictures have the time stamp of another",)
        poses, said = camera_poses(bag, frames, color.frame, len(order[0][0]), clock.by_log)
        marks = fingerprint(path, bag.files) if path.is_dir() else fingerprint_of(path)
        return Streams(
            name=path.resolve().name if path.is_dir() else path.stem,
            source=str(path),
            color_times=_seconds(order[0][0]),
            depth_times=_seconds(order[1][0]),
            read_color=lambda k: _color(bag, color, int(order[0][1][k])),
            read_depth=lambda k: _depth(bag, depth, int(order[1][1][k]), unit),
            rig=rig,
            fingerprint=digest(marks, color.name, depth.name),
            poses=poses,
            warnings=warnings + ((said,) if said else ()),
            metadata={"color_topic": color.name, "depth_topic": depth.name},
        )

    def _rig(self, bag: Bag, frames: Frames, color: Camera, depth: Camera) -> Rig:
        """Both cameras. Raises InputError when a camera's numbers or their transform are missing."""
        near, far = lens_of(bag, color), lens_of(bag, depth)
        together = lies_on(depth, color)
        if together and color.size == depth.size:
            near, far = near or far, far or near
        for camera, lens, told in ((color, near, "color"), (depth, far, "depth")):
            both = together and color.size == depth.size and "color" in self.calibrated
            if lens is None and not (told in self.calibrated or both):
                raise InputError(
                    f"{bag.shown} has no CameraInfo of {camera.name}",
                    f"record {camera.place}/camera_info too, or give --calibration",
                )
        near, far = near or _stand_in(bag, color), far or _stand_in(bag, depth)
        if together:
            return Rig(near, near if _same(near, far) else far)
        T = frames.between(color.frame, depth.frame)
        if T is None and "pose" not in self.calibrated:
            between = f"{color.frame or color.name} and {depth.frame or depth.name}"
            raise InputError(
                f"{bag.shown} has no transform between {between} in /tf_static",
                "record /tf_static, or the depth topic that is aligned to colour, or give --calibration",
            )
        return Rig(near, far, np.full((4, 4), np.nan) if T is None else T)


@dataclass(frozen=True, eq=False)
class _Clock:
    """Times (ns) of the messages of the colour and of the depth topic; by_log: they are log times."""

    stamps: tuple[NDArray[np.int64], NDArray[np.int64]]
    by_log: bool


def _clock(bag: Bag, color: Topic, depth: Topic) -> tuple[_Clock, tuple[str, ...]]:
    stamps = [_stamps(bag, topic) for topic in (color, depth)]
    logged = _Clock((color.times, depth.times), True)
    if any(np.count_nonzero(s == 0) > 1 for s in stamps):  # one: a simulator's clock begins with it
        return logged, (
            f"{bag.path.name}: its messages have no time stamps, the times at which they were logged stand for them",
        )
    if _meet(*stamps) or not _meet(color.times, depth.times):
        return _Clock((stamps[0], stamps[1]), False), ()
    return logged, (
        f"{bag.path.name}: colour and depth are stamped by different clocks, the times of logging stand for them",
    )


def _meet(first: NDArray[np.int64], second: NDArray[np.int64]) -> bool:
    return bool(first.min() <= second.max() and second.min() <= first.max())


def _stamps(bag: Bag, topic: Topic) -> NDArray[np.int64]:
    """Header stamps (ns) of all messages of a topic.

    If a message's head can't be read alone, `_SAMPLES` messages stand for all with even stamps.
    """

    def read(indices: NDArray[np.int64]) -> NDArray[np.int64]:
        with guarded(f"{bag.shown}: a message of {topic.name}"):
            heads = topic.many(indices.tolist(), HEAD)
            return np.array([ros_images.stamp_of(h, topic.encoding) for h in heads], dtype=np.int64)

    every = np.arange(len(topic.times))
    if not topic.cheap and len(every) > _SAMPLES:
        some = np.linspace(0, len(every) - 1, _SAMPLES).astype(np.int64)
        found = read(some)
        apart = found - topic.times[some]
        if np.ptp(apart) <= _STEADY:
            return topic.times + int(np.median(apart))
    return read(every)


def _seconds(stamps: NDArray[np.int64]) -> Array:
    return np.asarray(stamps * 1e-9, dtype=np.float64)


def _stand_in(bag: Bag, camera: Camera) -> Lens:
    """A lens of the pictures' size, which the one that is told elsewhere replaces."""
    width, height = camera.size
    if min(width, height) <= 0:
        raise InputError(
            f"{bag.shown}: the pictures of {camera.name} tell no size", "record its camera_info too"
        )
    focal = float(max(width, height))
    return Lens(Intrinsics(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2))


def _same(a: Lens, b: Lens) -> bool:
    """Whether two lenses are one but for rounding."""
    if (a.camera.width, a.camera.height) != (b.camera.width, b.camera.height):
        return False
    return bool(np.abs(a.camera.vector - b.camera.vector).max() < _SAME) and (
        a.distortion == b.distortion or a.is_pinhole == b.is_pinhole is True
    )


def _color(bag: Bag, camera: Camera, index: int) -> NDArray[np.uint8]:
    name = f"{bag.shown}: {camera.name} {index}"
    with guarded(name):
        return ros_images.color_of(name, _message(camera.topic, index))


def _depth(bag: Bag, camera: Camera, index: int, unit: float) -> NDArray[np.float32]:
    name = f"{bag.shown}: {camera.name} {index}"
    with guarded(name):
        return ros_images.depth_of(name, _message(camera.topic, index), unit)


def _message(topic: Topic, index: int) -> ros_images.Image:
    return ros_images.parsed(topic.read(index), topic.type, topic.encoding)
