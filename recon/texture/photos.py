"""Photographs of one body: the pixels of each labelled frame that show it and no hand, in two bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numba
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
_AT_ONCE = 1 << 14  # faces


@dataclass(frozen=True, eq=False)
class Shots:
    """N frames as they were taken: color (N, H, W, 3), depth (N, H, W) m, labels with hands grown (N, H, W),
    T_world_cam (N, 4, 4) and sharpness (N,), the mean squared gradient of their brightness."""

    frames: Sequence[int]
    color: U8
    depth: F32
    labels: U8
    T_world_cam: Array
    sharpness: Array


@dataclass(frozen=True, eq=False)
class Photos:
    """K of N frames for one body. which (K,): their places among these; color (N, H, W, 3) and depth
    (N, H, W) m: of all; trust (K, H, W) 0..1: 0 off the body; low (K, h, w, 3): the body's colours without
    detail, its pixel `LOW` of the photograph; T_cam_body (K, 3, 4) from the body at state 0; camera: of the
    photographs."""

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
) -> Shots:
    """The frames, read and their hands grown; each has a pose."""
    size = (len(frames), recording.intrinsics.height, recording.intrinsics.width)
    colors, depths = np.empty((*size, 3), np.uint8), np.empty(size, np.float32)
    held = np.empty(size, np.uint8)

    def sharpness(k: int) -> float:
        color, depth = recording.frame(frames[k])
        colors[k], depths[k] = color, np.where(depth <= max_depth, depth, 0)
        held[k] = _without_hands(labels[frames[k]])
        grey = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32)
        return float((cv2.Sobel(grey, -1, 1, 0) ** 2 + cv2.Sobel(grey, -1, 0, 1) ** 2).mean())

    sharp = np.array(list(each(sharpness, range(len(frames)))))
    poses = cameras.T_world_cam[np.searchsorted(cameras.frames, frames)].reshape(-1, 4, 4)
    return Shots(frames, colors, depths, held, poses, sharp)


def _without_hands(labels: U8) -> U8:
    """Labels (H, W) in which hands have grown."""
    reach = max(1, round(_HAND * labels.shape[1]))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = cv2.dilate((labels == HAND_LABEL).astype(np.uint8), disc)
    return np.where(near > 0, np.uint8(HAND_LABEL), labels).astype(np.uint8)


def of_body(shots: Shots, key: int, poses: Sequence[Array | None], camera: Intrinsics) -> Photos:
    """The shots for the body with label `key` at poses T_world_body (4, 4), shot by shot; None: left out."""
    known = {k: pose for k, pose in enumerate(poses) if pose is not None}
    used = [k for k in known if np.any(shots.labels[k] == key)]
    typical = float(np.median(shots.sharpness)) if len(shots.sharpness) else 1.0

    def of_shot(k: int) -> tuple[F32, F32, Array]:
        own = (shots.labels[k] == key) & (shots.depth[k] > 0)
        # a blurred frame counts less, a busy one no more
        blur = min(1.0, float(shots.sharpness[k]) / max(typical, 1e-9))
        return (
            _trust(own, shots.depth[k]) * np.float32(blur),
            _low(shots.color[k], own),
            (geo.invert_pose(shots.T_world_cam[k]) @ known[k])[:3],
        )

    made = list(each(of_shot, used))
    h, w = camera.height, camera.width
    small = (-(-h // LOW), -(-w // LOW))
    return Photos(
        np.array(used, np.int64),
        shots.color,
        shots.depth,
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
    camera, rest = photos.camera, (photos.T_cam_body, photos.camera.vector)
    size = (camera.width, camera.height)

    def some(start: int) -> NDArray[np.bool_]:
        return np.asarray(
            _framed(np.ascontiguousarray(corners[start : start + _AT_ONCE]), *rest, size, reach)
        )

    made = list(each(some, range(0, len(corners), _AT_ONCE)))
    return np.concatenate(made) if made else np.zeros((0, len(photos.T_cam_body)), dtype=bool)


@numba.njit(cache=True, nogil=True)
def _framed(
    corners: Array, T: Array, lens: Array, size: tuple[int, int], reach: float
) -> NDArray[np.bool_]:  # pragma: no cover - compiled
    out = np.zeros((len(corners), len(T)), np.bool_)
    for f in range(len(corners)):
        for k in range(len(T)):
            far, close = -np.inf, np.inf
            left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
            for c in range(3):
                px, py, pz = corners[f, c, 0], corners[f, c, 1], corners[f, c, 2]
                x = T[k, 0, 0] * px + T[k, 0, 1] * py + T[k, 0, 2] * pz + T[k, 0, 3]
                y = T[k, 1, 0] * px + T[k, 1, 1] * py + T[k, 1, 2] * pz + T[k, 1, 3]
                z = T[k, 2, 0] * px + T[k, 2, 1] * py + T[k, 2, 2] * pz + T[k, 2, 3]
                far, close = max(far, z), min(close, z)
                u = x / max(z, 1e-9) * lens[0] + lens[2]
                v = y / max(z, 1e-9) * lens[1] + lens[3]
                left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
            close -= reach
            beyond = reach * max(lens[0], lens[1]) / max(close, 1e-9) * _ASLANT
            across = right + beyond >= 0 and left - beyond <= size[0] - 1
            inside = across and bottom + beyond >= 0 and top - beyond <= size[1] - 1
            out[f, k] = far + reach > 0 and (inside or close <= ZNEAR)
    return out
