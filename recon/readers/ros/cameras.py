"""ROS's cameras: the lens of an image topic by its CameraInfo, the depth unit of RealSense's recorder."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from recon.readers.encoded import require_pixels
from recon.readers.ros.choice import REALSENSE, Camera
from recon.readers.ros.images import METRES_PER_COUNT
from recon.readers.ros.topics import Bag, Topic
from recon.recording import Intrinsics
from recon.recording.rig import DISTORTION_COUNTS, Lens
from twin.errors import InputError

INFO, TEXT = "sensor_msgs/msg/CameraInfo", "std_msgs/msg/String"
_UNIT = re.compile(r"/option/Depth[_ ]Units/value$")
_RECTIFIED = re.compile(r"rect(?!_raw)")
_UNIT_RANGE = (1e-6, 0.1)  # metres per count, chosen by us: RealSense's go from 1e-6 to 0.01
_FOCAL_RANGE = (0.01, 1000.0)  # parts of the longer side, chosen by us: from 179 degrees to a tenth of one
_MAX_COEFFICIENT = 1e4  # chosen by us: a rational model's reach some hundred
# Distortion models whose numbers are OpenCV's. RealSense's "inverse" one is named after old firmware's; its
# own library projects with it as with others, its ROS 2 recorder writes the same as plumb_bob.
_BROWN = (
    "plumb_bob",
    "rational_polynomial",
    "thin_prism",
    "brown conrady",
    "modified brown conrady",
    "inverse brown conrady",
)


def lens_of(bag: Bag, camera: Camera) -> Lens | None:
    """The lens of an image topic; None when the bag tells none.

    Raises InputError when it is of another size than the pictures, or of a model that isn't read.
    """
    for topic in _infos(bag, camera):
        lens = _from_text(bag, topic) if topic.type == TEXT else _from_info(bag, topic, camera)
        if lens is None:
            continue
        k = lens.camera
        if camera.size != (0, 0) and camera.size != (k.width, k.height):
            raise InputError(
                f"{bag.shown}: {camera.name} is {camera.size[0]}x{camera.size[1]}, {topic.name} is of {k.width}x{k.height}",
                "record without binning and region of interest, or give --calibration",
            )
        return lens
    return None


def _infos(bag: Bag, camera: Camera) -> list[Topic]:
    """Topics of an image's camera, surest first: its own, its neighbours', one of its frame and size."""
    stream = REALSENSE.match(camera.name)
    names = [f"{camera.place}/camera_info", f"{camera.base}/camera_info"]
    if stream:
        names = [f"{stream[0]}/{inside}camera_info" for inside in ("info/", "image/", "image/data/", "")]
    found = [bag.topics[n] for n in names if n in bag.topics and len(bag.topics[n].times)]
    found = [t for t in found if t.type in (INFO, TEXT)]
    if found or stream:
        return found
    same = [t for t in bag.of_type(INFO) if _is_of(bag.message(t, 0), camera)]
    return same[:1] if len({str(_numbers(bag.message(t, 0))) for t in same}) == 1 else []


def _is_of(info: Any, camera: Camera) -> bool:
    frame = str(info.header.frame_id).lstrip("/")
    return bool(frame) and frame == camera.frame and camera.size in ((0, 0), (info.width, info.height))


def _numbers(info: Any) -> tuple[list[float], list[float], list[float], str]:
    """K (9), D, P (12) and the model; ROS 1 writes them in capitals."""
    k, d, p = (getattr(info, n) if hasattr(info, n) else getattr(info, n.upper()) for n in "kdp")
    return [float(v) for v in k], [float(v) for v in d], [float(v) for v in p], str(info.distortion_model)


def _from_info(bag: Bag, topic: Topic, camera: Camera) -> Lens | None:
    info = bag.message(topic, 0)
    k, d, p, model = _numbers(info)
    rectified = _RECTIFIED.search(camera.base.rpartition("/")[2]) is not None and p[0] > 0.0
    fx, fy, cx, cy = (p[0], p[5], p[2], p[6]) if rectified else (k[0], k[4], k[2], k[5])
    if not fx > 0.0:  # ROS's mark of a camera that isn't calibrated
        return None
    width, height = int(info.width) or camera.size[0], int(info.height) or camera.size[1]
    values = (width, height, fx, fy, cx, cy)
    return _lens(f"{bag.shown}: {topic.name}", values, [] if rectified else d, model)


def _from_text(bag: Bag, topic: Topic) -> Lens | None:
    """RealSense's ROS 2: width=..;height=..;fx=..;ppx=..;fy=..;ppy=..;model=..;coeffs=k1,k2,p1,p2,k3."""
    name = f"{bag.shown}: {topic.name}"
    text = str(bag.message(topic, 0).data)
    said = dict(piece.partition("=")[::2] for piece in text.split(";"))
    try:
        fx, fy, cx, cy = (float(said[n]) for n in ("fx", "fy", "ppx", "ppy"))
        d = [float(v) for v in said["coeffs"].split(",")]
        width, height = int(said["width"]), int(said["height"])
    except (KeyError, ValueError):
        raise InputError(
            f"{name} is no camera: {text[:80]!r}", "record again, or give --calibration"
        ) from None
    return _lens(name, (width, height, fx, fy, cx, cy), d, said.get("model", "")) if fx > 0.0 else None


def _lens(
    name: str, values: tuple[int, int, float, float, float, float], distortion: list[float], model: str
) -> Lens:
    d = tuple(distortion) if any(distortion) else ()
    if d and model.lower() not in _BROWN:
        raise InputError(
            f"{name} has the distortion model {model!r} with coefficients {_short(d)}",
            "undistort the images first (image_proc), or record rectified ones",
        )
    if len(d) not in DISTORTION_COUNTS or not np.all(np.isfinite(d)):
        raise InputError(
            f"{name} has {len(d)} distortion coefficients: {_short(d)}",
            "calibrate again, or give --calibration",
        )
    require_pixels(name, *values[:2])
    side = max(values[:2])
    if not all(_FOCAL_RANGE[0] * side <= f <= _FOCAL_RANGE[1] * side for f in values[2:4]) or any(
        abs(v) > _MAX_COEFFICIENT for v in d
    ):
        raise InputError(
            f"{name} has focal lengths {values[2]:.4g} and {values[3]:.4g} px at {values[0]}x{values[1]} and coefficients "
            f"{_short(d) or 'none'}",
            "calibrate again, or give --calibration",
        )
    try:
        return Lens(Intrinsics(*values), d)
    except InputError as error:
        raise InputError(f"{name}: {error.problem}", "calibrate again, or give --calibration") from None


def _short(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:.4g}" for v in values[:8]) + (", ..." if len(values) > 8 else "")


def depth_unit(bag: Bag, depth: Camera) -> float:
    """Metres per count of a depth topic: a millimetre, or RealSense's, with images or as an option.

    Raises InputError for a unit that no camera has.
    """
    stream = REALSENSE.match(depth.name)
    unit, told = METRES_PER_COUNT, depth.name
    if depth.first.unit:
        unit = depth.first.unit
    elif stream:
        sensor = stream[0].rpartition("/")[0]
        option = next((t for n, t in bag.topics.items() if n.startswith(sensor) and _UNIT.search(n)), None)
        if option is not None and len(option.times):
            told = option.name
            try:
                unit = float(bag.message(option, 0).data)
            except ValueError:
                raise InputError(f"{bag.shown}: {told} is no number", "record again") from None
    if not _UNIT_RANGE[0] <= unit <= _UNIT_RANGE[1]:
        raise InputError(
            f"{bag.shown}: {told} has a depth unit of {unit:.4g} m", "record again with Depth Units of 0.001"
        )
    return unit
