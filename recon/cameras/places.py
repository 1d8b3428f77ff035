"""Places seen again: keyframes that look alike, registered and accepted by geometry alone.

Candidates come from visual words of SIFT features (Sivic and Zisserman 2003). Rows of identical fronts look
alike as well: a pair counts where depth of both pictures agrees once they lie on each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cameras.depth_kernels import block_means, planes, refine
from recon.cameras.depth_poses import FARTHEST, FLAT, REACH, WIDTH, surface_of
from recon.cameras.rigid import point_sigmas, ransac_pose
from recon.dense.depth import F32, depth_sigma
from recon.dense.looks import HIDDEN, SAME, THROUGH, look
from recon.recording import Intrinsics, Recording
from recon.tracking.tracks import PIXEL_SIGMA
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each

# px of the pictures in which features are found, and their number: a third of them is seen again.
_PICTURE = 640
_FEATURES = 1000
# Visual words of a recording, and features that they are learnt from. Chosen by us.
_WORDS = 256
_LEARNT = 20_000
# Places that each keyframe is compared with. Chosen by us.
_CANDIDATES = 4
# Ratio of the nearest to the second descriptor (Lowe 2004).
_RATIO = 0.8
# Matches that agree on a pose, and standard deviations within which they do.
_FEWEST = 12
_SIGMAS = 4.0
_TRIES = 500
# Gates of the surfaces, sigmas, and rounds at each.
_GATES = ((6.0, 4), (3.0, 4))
# Depths agree within so many sigmas, and at least this, m: cameras drift within a keyframe's reach.
_AGREE = 4.0
_AGREE_M = 0.015
# Share of the points in the other view that agree, and that the other sees through. A row of identical fronts
# shifted by one has walls, floor and neighbours elsewhere.
_SAME = 0.65
_THROUGH = 0.15
# Share of the points that must lie in the other view.
_IN_VIEW = 0.25


@dataclass(frozen=True, eq=False)
class Keyframe:
    """Features of a frame: descriptors (n, 128), points (n, 3) m in its camera; its planes; surface points
    and normals (m, 3), thinned out; depth (h, w) m."""

    frame: int
    descriptors: F32
    points: Array
    plane: F32
    surface: Array
    normals: Array
    depth: F32


@dataclass(frozen=True, eq=False)
class Seen:
    """Two frames that see the same place: T_a_b (4, 4), the matches that agree, the share of surface too."""

    a: int
    b: int
    T_a_b: Array
    matches: int
    same: float


def keyframes_of(recording: Recording, frames: Sequence[int]) -> list[Keyframe]:
    """The keyframes of a recording."""
    k = recording.intrinsics
    scale = min(1.0, _PICTURE / k.width)
    size = (round(k.width * scale), round(k.height * scale))
    camera, step = k.scaled(*size), max(1, k.width // WIDTH)
    small = k.binned(step)

    def of(frame: int) -> Keyframe:
        color, depth = recording.frame(frame)
        grey = cv2.resize(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
        z = cv2.medianBlur(cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST), 3)
        points, descriptors = cv2.SIFT.create(nfeatures=_FEATURES).detectAndCompute(grey, None)
        px = np.array([p.pt for p in points]).reshape(-1, 2)
        x, y = np.clip(np.rint(px).astype(int), 0, np.array(size) - 1).T
        near = (z[y, x] > 0) & (z[y, x] < FARTHEST)
        found = descriptors if descriptors is not None else np.zeros((0, 128), np.float32)
        root = np.sqrt(found[near] / np.maximum(found[near].sum(axis=1, keepdims=True), 1e-9))
        plane = planes(block_means(depth, step, 2 if step > 2 else 1), small.vector, REACH, FLAT)
        surface, normals = surface_of(plane, small)
        thin = np.ascontiguousarray(depth[::step, ::step], np.float32)
        at = camera.backproject(px[near], z[y, x][near].astype(float))
        return Keyframe(frame, root.astype(np.float32), at, plane, surface, normals, thin)

    return list(each(of, frames))


def alike(keys: Sequence[Keyframe]) -> Array:
    """How alike keyframes look (n, n), 0..1: cosines of their visual words, rare ones counting more."""
    every = np.concatenate([k.descriptors for k in keys])
    if len(every) < _WORDS:
        return np.zeros((len(keys), len(keys)))
    some = every[:: max(1, len(every) // _LEARNT)]
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 12, 1e-3)
    _, _, words = cv2.kmeans(some, _WORDS, None, stop, 1, cv2.KMEANS_PP_CENTERS)  # type: ignore[call-overload]
    count = np.zeros((len(keys), _WORDS))
    for row, key in zip(count, keys, strict=True):
        if len(key.descriptors):
            nearest = np.argmax(key.descriptors @ words.T - 0.5 * (words**2).sum(axis=1), axis=1)
            row += np.bincount(nearest, minlength=_WORDS)
    rare = np.log((1 + len(keys)) / (1 + (count > 0).sum(axis=0)))
    weighted = np.sqrt(count) * rare
    weighted /= np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-9)
    return np.asarray(weighted @ weighted.T)


def sharpness(recording: Recording, frame: int) -> float:
    """Mean squared gradient of a frame's brightness, grey levels per pixel of a picture half as wide."""
    grey = cv2.cvtColor(recording.color(frame), cv2.COLOR_RGB2GRAY)
    half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA).astype(np.float32)
    return float((np.diff(half, axis=0) ** 2).mean() + (np.diff(half, axis=1) ** 2).mean())


def places_seen_again(
    keys: Sequence[Keyframe],
    allowed: NDArray[np.bool_],
    camera: Intrinsics,
    candidates: int | None = _CANDIDATES,
) -> list[Seen]:
    """Pairs of keyframes that see the same place.

    Args:
        allowed: (n, n) which pairs may be tried.
        camera: of the recording.
        candidates: places that each keyframe is compared with, those that look most alike; None: all.
    """
    score = np.where(allowed, alike(keys) if candidates is not None else 1.0, 0.0)
    pairs = set()
    for i in range(len(keys)):
        for j in np.argsort(-score[i], kind="stable")[:candidates]:
            if score[i, j] > 0:
                pairs.add((min(i, int(j)), max(i, int(j))))
    found = each(lambda p: register(keys[p[0]], keys[p[1]], camera), sorted(pairs))
    return [seen for seen in found if seen is not None]


def register(a: Keyframe, b: Keyframe, camera: Intrinsics) -> Seen | None:
    """The second keyframe's pose in the first one's camera, None where geometry does not agree."""
    if min(len(a.descriptors), len(b.descriptors)) < _FEWEST:
        return None
    first, second = _matches(a.descriptors, b.descriptors)
    if len(first) < _FEWEST:
        return None
    there, here = a.points[first], b.points[second]
    lateral = PIXEL_SIGMA / camera.fx
    spread = np.hypot(np.hypot(*point_sigmas(there, lateral)), np.hypot(*point_sigmas(here, lateral)))
    rng = np.random.default_rng([a.frame, b.frame])
    pose = ransac_pose(here, there, spread, rng, tries=_TRIES, gate=_SIGMAS)
    agree = np.linalg.norm(geo.transform(pose, here) - there, axis=1) < _SIGMAS * spread
    if agree.sum() < _FEWEST:
        return None
    small = camera.binned(max(1, camera.width // WIDTH))
    count = int(agree.sum())  # the matches hold a shift along a bare wall, of which depth tells nothing
    matched = (np.zeros(count, np.int64), np.arange(count + 1), here[agree], there[agree], lateral)
    seen = (np.zeros(1, np.int64), (b.surface, b.normals, a.plane[None], small.vector), matched)
    for gate, rounds in _GATES:
        pose = refine(pose, np.eye(4)[None], *seen, gate, rounds, 1e-5)
    u, _, vt = np.linalg.svd(pose[:3, :3])
    pose = geo.make_pose(u @ vt, pose[:3, 3])
    shares = (_agreement(a, b, pose, camera), _agreement(b, a, geo.invert_pose(pose), camera))
    if any(same < _SAME or through > _THROUGH for same, through in shares):
        return None
    return Seen(a.frame, b.frame, pose, count, min(same for same, _ in shares))


def _matches(a: F32, b: F32) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Mutually nearest descriptors (n, 128), clearly nearer than the second ones."""
    near = a @ b.T
    best = np.argmax(near, axis=1)
    two = -np.partition(-near, 1, axis=1)[:, :2]
    distance = np.sqrt(np.maximum(2.0 - 2.0 * two, 0.0))
    rows = np.arange(len(a))
    kept = (np.argmax(near, axis=0)[best] == rows) & (distance[:, 0] < _RATIO * distance[:, 1])
    return rows[kept], best[kept]


def _agreement(a: Keyframe, b: Keyframe, T_a_b: Array, camera: Intrinsics) -> tuple[float, float]:
    """Shares of b's surface in a's view that a sees there, and that a sees through; 0, 1 of hardly any."""
    thin = camera.strided(max(1, camera.width // WIDTH))
    sigma = float(depth_sigma(1.0))
    lens = (thin.fx, thin.fy, thin.cx, thin.cy)
    told = look(geo.transform(T_a_b, b.surface), np.eye(4), a.depth, *lens, _AGREE_M, _AGREE * sigma)
    count = np.bincount(told, minlength=4)
    known = count[SAME] + count[THROUGH] + count[HIDDEN]
    if known < _IN_VIEW * len(b.surface):
        return 0.0, 1.0
    return count[SAME] / known, count[THROUGH] / known
