"""Photographs of one body: the pixels of each labelled frame that show it and no hand, in two bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32, MAX_STEP
from recon.recording import Intrinsics, Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each
from twin.scene import HAND_LABEL, Trajectory

U8 = NDArray[np.uint8]

# Chosen by us and the same for every recording.
LOW = 4  # px of the photograph a pixel of its low band
_BLUR = 0.8  # pixels of the low band: its standard deviation is 3 px of the photograph
_HAND = 0.06  # of the picture's width around a hand that shows its soft edge and the shadow close to it
_RIM = 1.0  # px from a body's outline within which a pixel counts least
_FULL = 5.0  # px from it from which on a pixel counts fully
_LEAST = 0.03  # what a pixel at the outline counts: used where nothing better shows the place
ZNEAR = 0.05  # m from the camera, within which nothing is seen
# a step on a plane seen aslant in the corner of a picture spans less than so many of its pixels
_ASLANT = 2.0


@dataclass(frozen=True, eq=False)
class Shot:
    """One frame as it was taken: colour (H, W, 3), depth (H, W) m, labels with hands grown (H, W), pose and
    sharpness (mean squared gradient of its brightness)."""

    frame: int
    color: U8
    depth: F32
    labels: U8
    T_world_cam: Array
    sharpness: float


@dataclass(frozen=True, eq=False)
class Photos:
    """K frames for one body. which (K,): their places among all shots; color (K, H, W, 3); depth (K, H, W) m;
    trust (K, H, W) 0..1: 0 off the body; low (K, h, w, 3): the body's colours without detail, its pixel `LOW`
    of the photograph; T_cam_body (K, 3, 4) from the body at state 0; camera: of the photographs."""

    which: NDArray[np.int64]
    color: U8
    depth: F32
    trust: F32
    low: F32
    T_cam_body: Array
    camera: Intrinsics


def take(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, U8],
    frames: Sequence[int],
    max_depth: float,
) -> list[Shot]:
    """The frames, read and their hands grown."""

    def shot(frame: int) -> Shot:
        color, depth = recording.frame(frame)
        z = np.where(depth <= max_depth, depth, 0).astype(np.float32)
        grey = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32)
        sharp = float((cv2.Sobel(grey, -1, 1, 0) ** 2 + cv2.Sobel(grey, -1, 0, 1) ** 2).mean())
        pose = cameras.pose(frame)
        assert pose is not None
        return Shot(frame, color, z, _without_hands(labels[frame]), pose, sharp)

    return list(each(shot, frames))


def _without_hands(labels: U8) -> U8:
    """Labels (H, W) in which hands have grown."""
    reach = max(1, round(_HAND * labels.shape[1]))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = cv2.dilate((labels == HAND_LABEL).astype(np.uint8), disc)
    return np.where(near > 0, np.uint8(HAND_LABEL), labels).astype(np.uint8)


def of_body(shots: Sequence[Shot], key: int, poses: Sequence[Array | None], camera: Intrinsics) -> Photos:
    """The shots for the body with label `key` at poses T_world_body (4, 4), shot by shot; None: left out."""
    used = [k for k, s in enumerate(shots) if poses[k] is not None and np.any(s.labels == key)]
    typical = float(np.median([s.sharpness for s in shots])) if shots else 1.0

    def of_shot(k: int) -> tuple[F32, F32, Array]:
        s, pose = shots[k], poses[k]
        assert pose is not None
        own = (s.labels == key) & (s.depth > 0)
        blur = min(1.0, s.sharpness / max(typical, 1e-9))  # a blurred frame counts less, a busy one no more
        return (
            _trust(own, s.depth) * np.float32(blur),
            _low(s.color, own),
            (geo.invert_pose(s.T_world_cam) @ pose)[:3],
        )

    made = list(each(of_shot, used))
    h, w = camera.height, camera.width
    small = (-(-h // LOW), -(-w // LOW))
    return Photos(
        np.array(used, np.int64),
        _stack([shots[k].color for k in used], (h, w, 3), np.uint8),
        _stack([shots[k].depth for k in used], (h, w), np.float32),
        _stack([m[0] for m in made], (h, w), np.float32),
        _stack([m[1] for m in made], (*small, 3), np.float32),
        _stack([m[2] for m in made], (3, 4), np.float64),
        camera,
    )


def _stack(arrays: Sequence[NDArray[Any]], shape: tuple[int, ...], kind: Any) -> NDArray[Any]:
    """The arrays as one (K, *shape), also where there are none."""
    return np.array(arrays, dtype=kind).reshape(-1, *shape)


def _trust(own: NDArray[np.bool_], depth: F32) -> F32:
    """(H, W): 0 off the body, `_LEAST` at its outline and at steps of depth, rising to 1 inside."""
    near, far = cv2.erode(depth, np.ones((3, 3), np.uint8)), cv2.dilate(depth, np.ones((3, 3), np.uint8))
    step = far - near > 2 * MAX_STEP * depth
    inner = (own & ~step).astype(np.uint8)
    away = cv2.distanceTransform(np.pad(inner, 1, mode="edge"), cv2.DIST_L2, 3)[1:-1, 1:-1]
    rising = np.clip((away - _RIM) / (_FULL - _RIM), _LEAST, 1.0)
    return np.where(own, rising, 0.0).astype(np.float32)


def _low(color: U8, own: NDArray[np.bool_]) -> F32:
    """(h, w, 3): mean colour around each block of `LOW` px over the body's pixels; 0 far from its pixels."""
    h, w = own.shape
    size = (-(-w // LOW), -(-h // LOW))
    weight = own.astype(np.float32)
    pad = ((0, size[1] * LOW - h), (0, size[0] * LOW - w))
    weight = np.pad(weight, pad)
    lit = np.pad(color, (*pad, (0, 0))).astype(np.float32) * weight[..., None]
    total = cv2.GaussianBlur(cv2.resize(lit, size, interpolation=cv2.INTER_AREA), (0, 0), _BLUR)
    share = cv2.GaussianBlur(cv2.resize(weight, size, interpolation=cv2.INTER_AREA), (0, 0), _BLUR)
    return np.asarray(total / np.maximum(share, 1e-4)[..., None], dtype=np.float32)


def framed(corners: Array, photos: Photos, reach: float) -> NDArray[np.bool_]:
    """Photographs (F, K) within whose border something of a face with corners (F, 3, 3) m, or of its plane
    within `reach` m around, may lie."""
    camera = photos.camera
    out = np.zeros((len(corners), len(photos.T_cam_body)), dtype=bool)
    for k, T in enumerate(photos.T_cam_body):
        p = corners @ T[:, :3].T + T[:, 3]
        z = p[..., 2]
        far, close = z.max(axis=1), z.min(axis=1) - reach
        uv = p[..., :2] / np.maximum(z, 1e-9)[..., None] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        beyond = reach * max(camera.fx, camera.fy) / np.maximum(close, 1e-9) * _ASLANT
        low, high = uv.min(axis=1) - beyond[:, None], uv.max(axis=1) + beyond[:, None]
        inside = np.all((high >= 0) & (low <= [camera.width - 1, camera.height - 1]), axis=1)
        out[:, k] = (far + reach > 0) & (inside | (close <= ZNEAR))
    return out
