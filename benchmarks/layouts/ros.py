"""Write a recording as a ROS bag: ROS 1, and ROS 2 in SQLite or MCAP.

Messages are made and packed by the library rosbags; nothing is shared with the reader.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from recon.recording import Intrinsics, Recording
from twin.geometry import Array, invert_pose, quat_wxyz_from_matrix

COLOR, DEPTH = "/camera/color/image_raw", "/camera/depth/image_rect_raw"
ALIGNED = "/camera/aligned_depth_to_color/image_raw"
COLOR_FRAME, DEPTH_FRAME = "camera_color_optical_frame", "camera_depth_optical_frame"


@dataclass(frozen=True, eq=False)
class Style:
    """How a driver publishes.

    color, depth: an encoding, or "jpeg", "png"; "compressedDepth 16UC1", "compressedDepth 32FC1". padding:
    bytes behind each row. T_color_depth: None for depth aligned to colour. lag: frame -> ns that its messages
    are logged late. stamped: whether headers have times. odometry: whether nav_msgs/Odometry of `base_link`
    tells the poses. extra: more colour topics.
    """

    color: str = "rgb8"
    depth: str = "16UC1"
    padding: int = 0
    big_endian: bool = False
    T_color_depth: Array | None = None
    depth_camera: Intrinsics | None = None
    distortion: tuple[float, ...] = ()
    model: str = "plumb_bob"
    lag: Callable[[int], int] = lambda _: 0
    stamped: bool = True
    transforms: str = "/tf_static"
    camera_info: bool = True
    odometry: bool = False
    extra: tuple[str, ...] = ()
    color_topic: str = COLOR
    depth_topic: str = ""


@cache
def _store(ros1: bool) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        store.register(
            get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
        )
    return store


class Ros:
    """Messages of one release, and the bag that they go to."""

    def __init__(self, writer: Any, ros1: bool) -> None:
        self.writer, self.ros1 = writer, ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:
            types = get_types_from_msg(
                "geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"
            )
            self.store.register(types)
        self.connections: dict[str, Any] = {}

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def header(self, stamp: int, frame: str) -> Any:
        time = self.make("builtin_interfaces/msg/Time", stamp // 10**9, stamp % 10**9)
        return self.make("std_msgs/msg/Header", *((0,) if self.ros1 else ()), time, frame)

    def put(self, topic: str, kind: str, message: Any, log: int, tail: bytes = b"") -> None:
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        pack = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], log, bytes(pack(message, kind)) + tail)

    def image(self, stamp: int, frame: str, pixels: NDArray[Any], encoding: str, style: Style) -> Any:
        """An Image of (H, W) or (H, W, C) pixels as they are."""
        big = style.big_endian
        rows = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">" if big else "<")))
        flat = rows.view(np.uint8).reshape(len(rows), -1)
        flat = np.pad(flat, ((0, 0), (0, style.padding)), constant_values=171)
        height, width = pixels.shape[:2]
        values = (height, width, encoding, int(big), flat.shape[1], flat.reshape(-1))
        return self.make("sensor_msgs/msg/Image", self.header(stamp, frame), *values)

    def compressed(self, stamp: int, frame: str, form: str, data: bytes) -> Any:
        values = (form, np.frombuffer(data, np.uint8))
        return self.make("sensor_msgs/msg/CompressedImage", self.header(stamp, frame), *values)

    def info(self, stamp: int, frame: str, k: Intrinsics, model: str, d: tuple[float, ...]) -> Any:
        roi = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        matrix = np.array([k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1.0])
        projection = np.array([k.fx, 0, k.cx, 0, 0, k.fy, k.cy, 0, 0, 0, 1.0, 0])
        values = (k.height, k.width, model, np.array(d), matrix, np.eye(3).reshape(-1), projection, 0, 0, roi)
        return self.make("sensor_msgs/msg/CameraInfo", self.header(stamp, frame), *values)

    def transform(self, T: Array) -> Any:
        w, x, y, z = quat_wxyz_from_matrix(T[:3, :3]).tolist()
        rotation = self.make("geometry_msgs/msg/Quaternion", x, y, z, w)
        return self.make(
            "geometry_msgs/msg/Transform",
            self.make("geometry_msgs/msg/Vector3", *T[:3, 3].tolist()),
            rotation,
        )

    def tf(self, stamp: int, *edges: tuple[str, str, Array]) -> Any:
        found = [
            self.make("geometry_msgs/msg/TransformStamped", self.header(stamp, a), b, self.transform(T))
            for a, b, T in edges
        ]
        return self.make("tf2_msgs/msg/TFMessage", found)

    def odometry(self, stamp: int, frame: str, child: str, T: Array) -> Any:
        transform = self.transform(T)
        point = self.make("geometry_msgs/msg/Point", *T[:3, 3].tolist())
        pose = self.make("geometry_msgs/msg/Pose", point, transform.rotation)
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            self.header(stamp, frame),
            child,
            self.make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )


def write_ros1(recording: Recording, out: Path, style: Style | None = None, compression: str = "") -> Path:
    """A ROS 1 bag; compression "", "bz2" or "lz4"."""
    with ros1_bag(out, compression) as ros:
        write_into(ros, recording, style or Style())
    return out


def write_ros2(
    recording: Recording,
    out: Path,
    style: Style | None = None,
    storage: str = "sqlite3",
    compression: str = "",
) -> Path:
    """A folder of ROS 2's recorder with storage "sqlite3" or "mcap"; compression "", "message", "file" or
    "storage" (MCAP's chunks)."""
    with ros2_bag(out, storage, compression) as ros:
        write_into(ros, recording, style or Style())
    return out


@contextmanager
def ros1_bag(out: Path, compression: str = "") -> Iterator[Ros]:
    writer = rosbag1.Writer(out)
    if compression:
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
    with writer:
        yield Ros(writer, True)


@contextmanager
def ros2_bag(out: Path, storage: str = "sqlite3", compression: str = "") -> Iterator[Ros]:
    plugin = rosbag2.StoragePlugin.MCAP if storage == "mcap" else rosbag2.StoragePlugin.SQLITE3
    writer = rosbag2.Writer(out, version=9, storage_plugin=plugin)
    if compression:
        mode = rosbag2.CompressionMode[compression.upper()]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        yield Ros(writer, False)


def write_into(ros: Ros, recording: Recording, style: Style) -> None:
    aligned = style.T_color_depth is None
    depth_topic = style.depth_topic or (ALIGNED if aligned else DEPTH)
    depth_frame = COLOR_FRAME if aligned else DEPTH_FRAME
    depth_camera = style.depth_camera or recording.intrinsics
    stamps = [round(t * 1e9) for t in recording.times]
    if style.T_color_depth is not None and style.transforms:
        edges = (
            ("camera_link", COLOR_FRAME, np.eye(4)),
            ("camera_link", DEPTH_FRAME, style.T_color_depth),
        )
        again = stamps if style.transforms == "/tf" else stamps[:1]
        for stamp in again:
            ros.put(style.transforms, "tf2_msgs/msg/TFMessage", ros.tf(stamp, *edges), stamp)
    for k, stamp in enumerate(stamps):
        log, mark = stamp + style.lag(k), stamp if style.stamped else 0
        frame = recording.frame(k)
        for topic in (style.color_topic, *style.extra):
            put_color(ros, topic, frame.color, mark, log, style)
        put_depth(ros, depth_topic, frame.depth, mark, log, depth_frame, style)
        if style.camera_info:
            lens = (style.model, style.distortion)
            depth_lens = lens if aligned else ("plumb_bob", (0.0,) * 5)
            info = ros.info(mark, COLOR_FRAME, recording.intrinsics, *lens)
            ros.put(f"{place_of(style.color_topic)}/camera_info", "sensor_msgs/msg/CameraInfo", info, log)
            info = ros.info(mark, depth_frame, depth_camera, *depth_lens)
            ros.put(f"{place_of(depth_topic)}/camera_info", "sensor_msgs/msg/CameraInfo", info, log)
        if style.odometry and recording.poses is not None:
            _put_odometry(ros, recording, k, mark, log)


def place_of(topic: str) -> str:
    return topic.rpartition("/")[0]


def put_color(ros: Ros, topic: str, color: NDArray[np.uint8], stamp: int, log: int, style: Style) -> None:
    if style.color in ("jpeg", "png"):
        suffix = f".{style.color}".replace("jpeg", "jpg")
        data = cv2.imencode(suffix, np.ascontiguousarray(color[..., ::-1]))[1].tobytes()
        form = f"rgb8; {style.color} compressed bgr8"
        message = ros.compressed(stamp, COLOR_FRAME, form, data)
        ros.put(f"{topic}/compressed", "sensor_msgs/msg/CompressedImage", message, log)
        return
    pixels = encoded(color, style.color)
    ros.put(topic, "sensor_msgs/msg/Image", ros.image(stamp, COLOR_FRAME, pixels, style.color, style), log)


def encoded(color: NDArray[np.uint8], encoding: str) -> NDArray[Any]:
    """Pixels of an encoding of image_encodings.hpp from RGB (H, W, 3); YUV with each pair's own luma and its
    first pixel's colour."""
    alpha = np.full((*color.shape[:2], 1), 9, np.uint8)
    if encoding in ("rgb16", "bgr16"):
        wide = color.astype(np.uint16) * 256 + 77  # the lower byte is no copy of the upper one
        return wide if encoding == "rgb16" else wide[..., ::-1]
    if encoding in ("mono8", "8UC1"):
        return color[..., 0]
    if encoding.startswith("bayer"):
        tile = encoding[6:10]
        out = np.zeros(color.shape[:2], np.uint8)
        for n, letter in enumerate(tile):
            y, x = divmod(n, 2)
            out[y::2, x::2] = color[y::2, x::2, "rgb".index(letter)]
        return out
    if encoding in ("yuv422", "uyvy", "yuv422_yuy2", "yuyv"):
        y, u, v = np.moveaxis(_bt601(color), -1, 0)
        chroma = np.where(
            np.arange(color.shape[1]) % 2 == 0, np.repeat(u[:, ::2], 2, 1), np.repeat(v[:, ::2], 2, 1)
        )
        pair = (y, chroma) if "yuy" in encoding else (chroma, y)
        return np.stack(pair, axis=-1)
    order = {"rgb8": color, "bgr8": color[..., ::-1], "8UC3": color[..., ::-1]}
    if encoding in order:
        return order[encoding]
    return np.concatenate([color if encoding == "rgba8" else color[..., ::-1], alpha], axis=-1)


def _bt601(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Studio-range YCbCr of ITU-R BT.601, as USB cameras send it."""
    r, g, b = np.moveaxis(color.astype(np.float64), -1, 0)
    y = 16 + (65.738 * r + 129.057 * g + 25.064 * b) / 256
    u = 128 + (-37.945 * r - 74.494 * g + 112.439 * b) / 256
    v = 128 + (112.439 * r - 94.154 * g - 18.285 * b) / 256
    return np.rint(np.stack([y, u, v], axis=-1)).astype(np.uint8)


def put_depth(
    ros: Ros, topic: str, depth: NDArray[np.float32], stamp: int, log: int, frame: str, style: Style
) -> None:
    kind, _, form = style.depth.rpartition(" ")
    if not kind:
        pixels = depth.astype(np.float32) if form == "32FC1" else np.rint(depth * 1000).astype(np.uint16)
        ros.put(topic, "sensor_msgs/msg/Image", ros.image(stamp, frame, pixels, form, style), log)
        return
    header, values = struct.pack("<iff", 0, 0.0, 0.0), np.rint(depth * 1000).astype(np.uint16)
    if form == "32FC1":  # compressed_depth_image_transport's defaults: 10 m, quantisation 100
        a, b = 100.0 * 101.0, 1.0 - 101.0 * 100.0 / 10.0
        known = depth > 0
        quantised = np.rint(a / np.where(known, depth, 1.0) + b)
        header, values = struct.pack("<iff", 0, a, b), np.where(known, quantised, 0).astype(np.uint16)
    data = header + cv2.imencode(".png", values)[1].tobytes()
    message = ros.compressed(stamp, frame, f"{form}; compressedDepth png", data)
    ros.put(f"{topic}/compressedDepth", "sensor_msgs/msg/CompressedImage", message, log)


T_BASE_CAMERA = np.array(
    [[0.0, 0, 1, 0.1], [-1, 0, 0, 0.02], [0, -1, 0, 0.3], [0, 0, 0, 1]]
)  # looks ahead of the base


def _put_odometry(ros: Ros, recording: Recording, k: int, stamp: int, log: int) -> None:
    """Odometry of a base that carries the camera, twice a frame as a faster clock would."""
    assert recording.poses is not None
    if k == 0:
        edge = ("base_link", COLOR_FRAME, T_BASE_CAMERA)
        ros.put("/tf_static", "tf2_msgs/msg/TFMessage", ros.tf(stamp, edge), log)
    T = recording.poses.T_world_cam[k] @ invert_pose(T_BASE_CAMERA)
    ros.put("/odom", "nav_msgs/msg/Odometry", ros.odometry(stamp, "odom", "base_link", T), log)
