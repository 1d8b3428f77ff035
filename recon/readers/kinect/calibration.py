"""Factory calibration of an Azure Kinect: one JSON for the full sensors, brought to the pictures of a mode.

Principal point and focal length are stored on a unit square whose corner is the corner of the first pixel. A
mode's picture is cut out of the sensor's picture at some scale. Scales, cuts, and what the coefficients mean
are those of the Azure Kinect Sensor SDK (MIT: mode_specific_calibration.c, intrinsic_transformation.c).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from recon.recording import Intrinsics
from recon.recording.rig import Lens, Rig
from twin.errors import InputError
from twin.geometry import Array, invert_pose, is_rotation, make_pose

Size = tuple[int, int]

# Depth picture -> the sensor's picture it is cut from, where: NFOV and WFOV, each unbinned and 2x2 binned.
DEPTH_MODES: dict[Size, tuple[Size, Size]] = {
    (640, 576): ((1024, 1024), (192, 180)),
    (320, 288): ((512, 512), (96, 90)),
    (512, 512): ((512, 512), (0, 0)),
    (1024, 1024): ((1024, 1024), (0, 0)),
}
DEPTH_SENSOR = (1024, 1024)
MAX_ROTATION_ERROR = 1e-4  # of a product of columns, chosen by us: the nine numbers are stored as float32
MAX_CROSS_TERM = 0.5  # px, chosen by us: how far the older lens model may be from OpenCV's
_AGAIN = "record again, or attach the device's own calibration.json"


def rig_of(data: bytes, name: str, color: Size, depth: Size) -> Rig:
    """Both cameras at the sizes (width, height) of their pictures; `name` is the file's, for messages.

    Raises InputError for sizes of no mode, and for an incomplete calibration or another lens model.
    """
    try:
        cameras = json.loads(data.rstrip(b"\0"))["CalibrationInformation"]["Cameras"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        what = f"{type(error).__name__} {error}"[:80]
        raise InputError(f"{name}: its calibration lists no cameras ({what})", _AGAIN) from None
    cameras = cameras if isinstance(cameras, list) else []
    seen, colored = _Camera.read(cameras, name, "D0"), _Camera.read(cameras, name, "PV0")
    if depth not in DEPTH_MODES or seen.sensor != DEPTH_SENSOR:
        sizes = ", ".join(f"{w}x{h}" for w, h in DEPTH_MODES)
        raise InputError(
            f"{name}: depth is {depth[0]}x{depth[1]} of a sensor of {seen.sensor[0]}x{seen.sensor[1]}, not {sizes} of "
            f"{DEPTH_SENSOR[0]}x{DEPTH_SENSOR[1]}",
            "give depth as it was recorded",
        )
    width, height = color
    full = (width, width * 3 // 4)
    if color not in ((width, width * 3 / 4), (width, width * 9 / 16)):
        raise InputError(
            f"{name}: colour is {width}x{height}, neither 4:3 nor 16:9", "give colour as it was recorded"
        )
    return Rig(
        colored.on_4_3().lens(color, full, (0, (full[1] - height) / 2)),
        seen.lens(depth, *DEPTH_MODES[depth]),
        colored.T_camera_device @ invert_pose(seen.T_camera_device),
    )


@dataclass(frozen=True, eq=False)
class _Camera:
    """A calibrated camera. parameters: (14,) cx cy fx fy k1..k6 codx cody p2 p1, four on the unit square."""

    what: str
    sensor: Size
    model: str
    parameters: Array
    T_camera_device: Array

    @classmethod
    def read(cls, cameras: list[Any], name: str, place: str) -> _Camera:
        """The camera at "D0" or "PV0". Raises InputError when something is missing or is no number."""
        what = f"{name}: its calibration of camera {place}"
        try:
            camera = next(c for c in cameras if c["Location"] == f"CALIBRATION_CameraLocation{place}")
            model = str(camera["Intrinsics"]["ModelType"]).removeprefix("CALIBRATION_LensDistortionModel")
            sides = [camera["SensorWidth"], camera["SensorHeight"]]
            lists = (
                camera["Intrinsics"]["ModelParameters"],
                camera["Rt"]["Rotation"],
                camera["Rt"]["Translation"],
            )
            numbers = [np.array(v, dtype=np.float64) for v in (*lists, sides)]
        except StopIteration:
            raise InputError(f"{what} is missing", _AGAIN) from None
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{what} is incomplete ({type(error).__name__} {error})"[:150], _AGAIN) from None
        shapes = [n.shape for n in numbers]
        if shapes != [(14,), (9,), (3,), (2,)] or not all(np.isfinite(n).all() for n in numbers):
            raise InputError(f"{what} has {shapes} values, not 14, 9, 3 and 2 finite ones"[:150], _AGAIN)
        parameters, rotation, translation, size = numbers
        if not is_rotation(rotation.reshape(3, 3), MAX_ROTATION_ERROR):
            raise InputError(f"{what} has no rotation, but {rotation.tolist()}"[:150], _AGAIN)
        pose = make_pose(rotation.reshape(3, 3), translation)
        return cls(what, (int(size[0]), int(size[1])), model, parameters, pose)

    def on_4_3(self) -> _Camera:
        """The camera on the whole 4:3 sensor; early devices were calibrated on its middle 16:9 picture."""
        width, height = self.sensor
        if width * 3 == height * 4:
            return self
        if width * 9 != height * 16:
            raise InputError(f"{self.what} is of {width}x{height}, neither 4:3 nor 16:9", _AGAIN)
        parameters = self.parameters.copy()
        parameters[[1, 3]] *= 0.75  # 2304 of 3072 rows
        parameters[1] += 0.125  # after the first 384
        return replace(self, sensor=(width, width * 3 // 4), parameters=parameters)

    def lens(self, size: Size, full: Size, cut: tuple[float, float]) -> Lens:
        """The lens of pictures of `size` from `cut` of the sensor's picture at the scale of `full`, px."""
        cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, codx, cody, p2, p1 = self.parameters.tolist()
        # The older model lacks a factor of two in the tangential terms with x y.
        term = {"BrownConrady": 0.0, "Rational6KT": max(abs(p1), abs(p2))}.get(self.model)
        off = (
            np.inf
            if term is None or min(fx, fy) <= 0
            else term * size[0] * size[1] / (4 * min(fx * full[0], fy * full[1]))
        )
        if not off <= MAX_CROSS_TERM or (codx, cody) != (0.0, 0.0):
            raise InputError(
                f"{self.what} has lens model {self.model[:40]!r} with focal lengths {fx:.4g} {fy:.4g}, p1 {p1:.4g}, "
                f"p2 {p2:.4g}, codx {codx:.4g}, cody {cody:.4g}, which is not OpenCV's",
                "undistort the pictures with the device's SDK, and give them as a folder with intrinsic.json",
            )
        at = cx * full[0] - cut[0] - 0.5, cy * full[1] - cut[1] - 0.5
        try:
            camera = Intrinsics(*size, fx * full[0], fy * full[1], *at)
        except InputError as error:
            raise InputError(f"{self.what}: {error.problem}", error.remedy) from None
        return Lens(camera, (k1, k2, p1, p2, k3, k4, k5, k6))
