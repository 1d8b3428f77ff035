"""Recordings from arrays in memory, checked frame by frame and never copied as a whole."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.recording.intrinsics import Intrinsics
from twin import geometry as geo
from twin.errors import FuntwinError, InputError
from twin.geometry import Array
from twin.scene import Trajectory

# m, median over all known pixels: rooms are smaller. Chosen by us.
FARTHEST = 50.0
# m, median over all known pixels: no depth camera measures nearer. Chosen by us.
NEAREST = 0.03


def fields_of_arrays(
    color: Any,
    depth: Any,
    intrinsics: Intrinsics | ArrayLike,
    times: ArrayLike | None,
    fps: float | None,
    depth_scale: float | None,
    poses: Trajectory | ArrayLike | None,
    gravity_camera0: ArrayLike | None,
) -> dict[str, Any]:
    """The fields of a recording but its name; see `Recording.from_arrays`."""
    count, height, width = _sizes(color, depth)
    camera = _camera(intrinsics, width, height)
    clock = _clock(times, fps, count)
    read = _Frames(color, depth, (height, width), _counts_per_metre(depth[0], depth_scale))
    gravity = None if gravity_camera0 is None else _gravity(gravity_camera0)
    trajectory = None if poses is None else _trajectory(poses, clock)
    digest = _digest(camera, clock, trajectory, gravity)
    return {
        "times": clock,
        "intrinsics": camera,
        "read_color": read.image,
        "read_depth": read.metres,
        "fingerprint": _check_all(read, count, digest),
        "poses": trajectory,
        "gravity_camera0": gravity,
    }


@dataclass(frozen=True, eq=False)
class _Frames:
    """Reads frame after frame from the user's arrays, which stay as they are."""

    color: Any
    depth: Any
    size: tuple[int, int]
    per_metre: float

    def image(self, index: int) -> NDArray[np.uint8]:
        """Colour (H, W, 3) of a frame, a copy."""
        image = np.array(self.color[index])
        if image.dtype != np.uint8:
            raise InputError(
                f"colour of frame {index} is {_range(image)}, not uint8",
                "multiply by 255, round, and convert to uint8"
                if _range_in_unit(image)
                else "give RGB values 0 to 255 as uint8",
            )
        self._check_size(index, "colour", image.shape, (*self.size, 3))
        return image

    def metres(self, index: int) -> NDArray[np.float32]:
        """Depth (H, W) m of a frame, 0 where it is unknown, a copy."""
        raw = np.asarray(self.depth[index])
        self._check_size(index, "depth", raw.shape, self.size)
        with np.errstate(invalid="ignore"):
            metres = (raw.astype(np.float32) / np.float32(self.per_metre)).astype(np.float32)
            lowest = np.nanmin(metres, initial=0.0)
        if lowest < 0:
            raise InputError(
                f"depth of frame {index} is negative, down to {lowest:.4g} m",
                "give the distance along the view, positive (OpenGL's z has the other sign), 0 for unknown",
            )
        return np.where(np.isfinite(metres), metres, np.float32(0.0))

    def _check_size(self, index: int, what: str, shape: tuple[int, ...], first: tuple[int, ...]) -> None:
        if shape != first:
            raise InputError(
                f"frame {index} has {what} {shape}, the first one {first}", "give all frames in one size"
            )


def _sizes(color: Any, depth: Any) -> tuple[int, int, int]:
    """Frames, height and width. Raises InputError that tells which axes are others than (T, H, W)."""
    for what, value in (("color", color), ("depth", depth)):
        try:
            empty = len(value) == 0
        except TypeError:
            empty = True
        if empty:
            raise InputError(
                f"{what} is {type(value).__name__} without frames", "give an array (T, H, W, ...)"
            )
    image, metres = np.asarray(color[0]), np.asarray(depth[0])
    if image.ndim != 3 or image.shape[2] != 3:
        raise InputError(f"color needs (T, H, W, 3), a frame has {image.shape}", _color_remedy(image))
    if metres.ndim != 2:
        raise InputError(
            f"depth needs (T, H, W), a frame has {metres.shape}",
            "take its only channel: depth[..., 0]" if metres.shape[2:] == (1,) else "put frames first",
        )
    if len(color) != len(depth):
        raise InputError(
            f"there are {len(color)} colour and {len(depth)} depth images",
            "give one depth image for each colour image",
        )
    if metres.shape != image.shape[:2]:
        turned = metres.shape == image.shape[1::-1]
        raise InputError(
            f"color has {image.shape[0]} rows and {image.shape[1]} columns, depth {metres.shape[0]} and {metres.shape[1]}",
            "depth has width before height: np.swapaxes(depth, 1, 2)"
            if turned
            else "register depth to the colour image",
        )
    return len(color), image.shape[0], image.shape[1]


def _color_remedy(image: NDArray[Any]) -> str:
    if image.ndim == 3 and image.shape[2] == 4:
        return "drop the fourth channel: color[..., :3]"
    if image.ndim == 3 and image.shape[0] in (3, 4):
        return "put channels last: np.moveaxis(color, 1, -1)"
    if image.ndim == 2 and image.shape[1] != 3:
        return "repeat grey as RGB: np.repeat(color[..., None], 3, axis=-1)"
    return "put frames first, then rows, columns and the three channels"


def _camera(intrinsics: Intrinsics | ArrayLike, width: int, height: int) -> Intrinsics:
    if isinstance(intrinsics, Intrinsics):
        if (intrinsics.width, intrinsics.height) != (width, height):
            raise InputError(
                f"intrinsics are of {intrinsics.width}x{intrinsics.height}, the images are {width}x{height}",
                "give those of this resolution: intrinsics.scaled(width, height) when only the resolution differs",
            )
        return intrinsics
    k = geo.as_float(intrinsics)
    if k.shape != (3, 3):
        raise InputError(f"intrinsics have shape {k.shape}", "give recon.Intrinsics or K (3, 3)")
    if np.any(k[2, :2] != 0) and not np.any(k[:2, 2] != 0):
        raise InputError(f"K is column by column: {k.tolist()}", "give its transpose: K.T")
    if abs(k[2, 2] - 1) > 1e-9 or np.any(k[2, :2] != 0) or k[1, 0] != 0 or abs(k[0, 1]) > 1e-6 * abs(k[0, 0]):
        raise InputError(
            f"K is {k.tolist()}, no pinhole camera without skew", "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
        )
    off, off_turned = (
        abs(k[:2, 2] - np.array([width, height]) / 2),
        abs(k[:2, 2] - np.array([height, width]) / 2),
    )
    # a tenth, by us: centres are within 5 % of the middle
    if width != height and off_turned.sum() < 0.1 * off.sum():
        raise InputError(
            f"the images are {width}x{height}, but K has its centre at ({k[0, 2]:g}, {k[1, 2]:g}), that of {height}x{width}",
            "turn K with the images: swap fx with fy and cx with cy, or give height before width",
        )
    return Intrinsics(width, height, *(float(k[ij]) for ij in ((0, 0), (1, 1), (0, 2), (1, 2))))


def _clock(times: ArrayLike | None, fps: float | None, count: int) -> Array:
    if times is None and fps is not None:
        return np.arange(count) / _positive(fps, "fps", "give frames a second, such as 30")
    if times is None or fps is not None:
        raise InputError(
            "give either times or fps" + (", not both" if times is not None else ""),
            "times=(T,) in seconds, or fps=30",
        )
    clock = geo.as_float(times)
    if clock.shape != (count,):
        raise InputError(
            f"times have shape {clock.shape} for {count} frames",
            f"say fps={clock:g} if these are frames a second"
            if clock.ndim == 0
            else "give one time a frame, in seconds",
        )
    return clock


def _counts_per_metre(first: Any, depth_scale: float | None) -> float:
    kind = np.asarray(first).dtype
    if kind.kind not in "iuf" or kind.itemsize < 2:
        raise InputError(
            f"depth is {kind}, which can't hold distances",
            "give metres as float32, or uint16 with depth_scale",
        )
    if depth_scale is None:
        if kind.kind != "f":
            raise InputError(
                f"depth is {kind} and its unit is not said",
                "give depth_scale=1000 for millimetres, 5000 for TUM RGB-D",
            )
        return 1.0
    scale = _positive(depth_scale, "depth_scale", "give the depth values in a metre, 1000 for millimetres")
    if scale < 1:
        raise InputError(
            f"depth_scale is {scale:g}, metres a value",
            f"give the depth values in a metre: depth_scale={1 / scale:g}",
        )
    return scale


def _positive(value: Any, what: str, remedy: str) -> float:
    number = np.asarray(value)
    if number.shape != () or number.dtype.kind not in "iuf" or not 0 < number < np.inf:
        raise InputError(f"{what} is {value!r}"[:80], remedy)
    return float(number)


def _gravity(vector: ArrayLike) -> Array:
    g = geo.as_float(vector)
    if g.shape != (3,) or not np.isfinite(g).all() or np.linalg.norm(g) < 1e-9:
        raise InputError(
            f"gravity_camera0 is {np.array2string(g)}",
            "give three numbers that point down in the first camera's axes",
        )
    return geo.unit(g)


def _trajectory(poses: Trajectory | ArrayLike, times: Array) -> Trajectory:
    if isinstance(poses, Trajectory):
        if poses.frames[0] < 0 or poses.frames[-1] >= len(times):
            raise InputError(
                f"poses are of frames {poses.frames[0]} to {poses.frames[-1]}, there are {len(times)}",
                "leave out others",
            )
        return poses
    T = geo.as_float(poses)
    if T.shape != (len(times), 4, 4):
        raise InputError(
            f"poses have shape {T.shape} for {len(times)} frames",
            "give T_world_cam (T, 4, 4), NaN for a frame without one, or a twin.scene.Trajectory",
        )
    known = np.flatnonzero(np.isfinite(T).all(axis=(1, 2)))
    try:
        return Trajectory(known, times[known], T[known])
    except FuntwinError as e:
        raise InputError(f"poses: {e.problem}", "give camera to world with OpenCV's camera axes") from None


def _digest(camera: Intrinsics, clock: Array, poses: Trajectory | None, gravity: Array | None) -> Any:
    digest = hashlib.sha256(repr(camera).encode())
    parts = [clock, gravity] + ([] if poses is None else [poses.frames, poses.times, poses.T_world_cam])
    for values in parts:
        digest.update(b"none" if values is None else str(values.shape).encode() + values.tobytes())
    return digest


def _check_all(read: _Frames, count: int, digest: Any) -> str:
    """SHA-256 of all frames. Raises InputError where no frame has depth, or depth is in another unit."""
    middles = []
    for k in range(count):
        color, depth = read.image(k), read.metres(k)
        known = depth[depth > 0]
        if known.size:  # none where the lens was covered
            middles.append(float(np.median(known)))
        digest.update(color.tobytes() + depth.tobytes())
    if not middles:
        raise InputError(f"depth is unknown in all {count} frames", "record again, with depth")
    middle = float(np.median(middles))
    if not NEAREST <= middle <= FARTHEST:
        raise InputError(
            f"depth has a median of {middle:.4g} m" + (", as if in millimetres" if middle > FARTHEST else ""),
            "give depth_scale, the depth values in a metre: 1000 for millimetres, 1 for metres",
        )
    return str(digest.hexdigest())


def _range_in_unit(image: NDArray[Any]) -> bool:
    return image.dtype.kind == "f" and image.size > 0 and bool(image.min() >= 0 and image.max() <= 1)


def _range(image: NDArray[Any]) -> str:
    return (
        f"{image.dtype} from {image.min():.4g} to {image.max():.4g}" if image.size else f"empty {image.dtype}"
    )
