"""Colours of points on a body, from the photographs that show them.

Two bands (Burt and Adelson 1983, "A multiresolution spline with application to image mosaics"): what changes
slowly over a picture is a mean over all photographs of a point, so that brightness leaves no seams; detail is
that of the few that see the point best, so that it stays sharp.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from recon.dense.depth import F32
from recon.dense.noise import DepthNoise
from recon.texture.photos import LOW, ZNEAR, Photos
from twin.geometry import Array
from twin.runs.threads import each

# Chosen by us and the same for every recording.
BEST = 8  # photographs that share the detail of a point
SHARP = 2.0  # power of their weights: near 1 all share alike, far above only the best counts and seams show
# levels of 255 off the median of a point's photographs, at which one counts half: shadows, highlights
ODD = 12.0
_GRAZING = 0.1  # cosine at which a surface is seen too flat
_SIGMAS = 2.0  # deviations within which a reading agrees with the surface
_SURFACE = 0.006  # m, error of fusion and decimation
_TAPS = 0.6  # of the cubic weights must lie on the body's own pixels
_AT_ONCE = 1 << 16


@dataclass(frozen=True, eq=False)
class Shaded:
    """Colours (n, 3) float32 in 0..255, and how many photographs show each (n,); none: 0."""

    color: F32
    views: NDArray[np.uint8]


def shade(
    points: Array,
    normals: Array,
    photos: Photos,
    gains: Array,
    group: NDArray[np.int64],
    noise: DepthNoise,
    near: tuple[NDArray[np.bool_], NDArray[np.int32]] | None = None,
) -> Shaded:
    """Colours of points (n, 3) m with unit normals (n, 3) on a body at state 0; gains (G, K, 3) multiply each
    photograph's colours, each `group` (n,) of points having its own. near: photographs (F, K) that may show
    each face (`framed`), and the face (n,) of each point; None: all may show all."""
    bands = _bands(photos)
    among, face = near or (np.ones((1, len(bands.T)), dtype=bool), np.zeros(len(points), np.int32))

    def some(start: int) -> tuple[F32, NDArray[np.uint8]]:
        part = slice(start, start + _AT_ONCE)
        own = np.require(points[part], requirements=["C", "W"])  # _shade is compiled for one layout
        rest = (among, face[part], noise.base, noise.slope)
        return _shade(own, normals[part], photos.color, bands, gains, group[part], *rest)

    made = list(each(some, range(0, len(points), _AT_ONCE)))
    if not made:
        return Shaded(np.zeros((0, 3), np.float32), np.zeros(0, np.uint8))
    return Shaded(np.concatenate([m[0] for m in made]), np.concatenate([m[1] for m in made]))


def lows(points: Array, normals: Array, photos: Photos, noise: DepthNoise) -> tuple[Array, Array]:
    """What is shown of points (n, 3) m without detail: colours (n, K, 3), weights (n, K), 0 if unseen."""
    return _lows(points, normals, _bands(photos), noise.base, noise.slope)


class _Bands(NamedTuple):
    """`Photos` without their detail, as the compiled code takes them."""

    which: NDArray[np.int64]
    depth: F32
    trust: F32
    low: F32
    T: Array
    camera: Array


def _bands(photos: Photos) -> _Bands:
    return _Bands(
        photos.which, photos.depth, photos.trust, photos.low, photos.T_cam_body, photos.camera.vector
    )


@numba.njit(cache=True, nogil=True, inline="always")
def _seen(
    points: Array, normals: Array, p: int, bands: _Bands, k: int, base: float, slope: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Column and row of point p in photograph k, and its quality: (pixels per metre)^2 times trust."""
    which, depth, trust, _, T, camera = bands
    px, py, pz = points[p, 0], points[p, 1], points[p, 2]
    z = T[k, 2, 0] * px + T[k, 2, 1] * py + T[k, 2, 2] * pz + T[k, 2, 3]
    if z < ZNEAR:
        return 0.0, 0.0, 0.0
    x = T[k, 0, 0] * px + T[k, 0, 1] * py + T[k, 0, 2] * pz + T[k, 0, 3]
    y = T[k, 1, 0] * px + T[k, 1, 1] * py + T[k, 1, 2] * pz + T[k, 1, 3]
    u, v = x / z * camera[0] + camera[2], y / z * camera[1] + camera[3]
    _, h, w = depth.shape
    if u < 0 or v < 0 or u > w - 1 or v > h - 1:
        return 0.0, 0.0, 0.0
    i, j = int(v + 0.5), int(u + 0.5)
    if trust[k, i, j] <= 0:
        return 0.0, 0.0, 0.0
    ax, ay, az = normals[p, 0], normals[p, 1], normals[p, 2]
    nx = T[k, 0, 0] * ax + T[k, 0, 1] * ay + T[k, 0, 2] * az
    ny = T[k, 1, 0] * ax + T[k, 1, 1] * ay + T[k, 1, 2] * az
    nz = T[k, 2, 0] * ax + T[k, 2, 1] * ay + T[k, 2, 2] * az
    cosine = -(x * nx + y * ny + z * nz) / np.sqrt(x * x + y * y + z * z)
    if cosine < _GRAZING:
        return 0.0, 0.0, 0.0
    d = z - 0.4
    sigma = max(0.002 + 0.003 * d * d, base + slope * z * z)
    if abs(depth[which[k], i, j] - z) * cosine > _SURFACE + _SIGMAS * sigma * cosine:
        return 0.0, 0.0, 0.0
    # trust between pixels, so that weights change smoothly
    a, b = min(int(v), h - 2), min(int(u), w - 2)
    fv, fu = v - a, u - b
    t = (trust[k, a, b] * (1 - fu) + trust[k, a, b + 1] * fu) * (1 - fv) + (
        trust[k, a + 1, b] * (1 - fu) + trust[k, a + 1, b + 1] * fu
    ) * fv
    return u, v, t * cosine * (camera[0] / z) ** 2


@numba.njit(cache=True, nogil=True)
def _low_at(
    low: F32, k: int, u: float, v: float, out: Array, row: int
) -> None:  # pragma: no cover - compiled
    """Colour out[row] (3,) of the low band at a pixel of photograph k."""
    _, h, w, _ = low.shape
    x = min(max((u + 0.5) / LOW - 0.5, 0.0), w - 1.001)
    y = min(max((v + 0.5) / LOW - 0.5, 0.0), h - 1.001)
    i, j = int(y), int(x)
    fy, fx = y - i, x - j
    for c in range(3):
        top = low[k, i, j, c] * (1 - fx) + low[k, i, j + 1, c] * fx
        bottom = low[k, i + 1, j, c] * (1 - fx) + low[k, i + 1, j + 1, c] * fx
        out[row, c] = top * (1 - fy) + bottom * fy


@numba.njit(cache=True, nogil=True)
def _cubic(t: float) -> float:  # pragma: no cover - compiled
    """Keys' kernel (1981) with a = -0.5."""
    t = abs(t)
    if t < 1:
        return (1.5 * t - 2.5) * t * t + 1
    if t < 2:
        return ((-0.5 * t + 2.5) * t - 4) * t + 2
    return 0.0


@numba.njit(cache=True, nogil=True)
def _detail_at(
    color: NDArray[np.uint8], photo: int, trust: F32, k: int, u: float, v: float, out: Array
) -> bool:  # pragma: no cover - compiled
    """Colour (3,) between pixels of a photo, those of the body alone; False where too few of them are."""
    _, h, w, _ = color.shape
    i, j = int(np.floor(v)), int(np.floor(u))
    across = (_cubic(u - j + 1), _cubic(u - j), _cubic(u - j - 1), _cubic(u - j - 2))
    total = red = green = blue = 0.0
    for dy in range(4):
        y = i + dy - 1
        if y < 0 or y >= h:
            continue
        down = _cubic(v - y)
        for dx in range(4):
            x = j + dx - 1
            if x < 0 or x >= w or trust[k, y, x] <= 0:
                continue
            weight = down * across[dx]
            total += weight
            red += weight * color[photo, y, x, 0]
            green += weight * color[photo, y, x, 1]
            blue += weight * color[photo, y, x, 2]
    if total < _TAPS:
        return False
    out[0], out[1], out[2] = red / total, green / total, blue / total
    return True


@numba.njit(cache=True, nogil=True)
def _weighted_median(
    values: Array, weights: Array, order: NDArray[np.int64], count: int
) -> float:  # pragma: no cover - compiled
    """Of the first `count` values; `order` is written over. By insertion: a point has few photographs."""
    half = 0.0
    for k in range(count):
        half += 0.5 * weights[k]
        at = k
        while at > 0 and values[order[at - 1]] > values[k]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
    run = 0.0
    for k in range(count):
        run += weights[order[k]]
        if run >= half:
            return values[order[k]]
    return values[order[count - 1]]


@numba.njit(cache=True, nogil=True)
def _lows(
    points: Array, normals: Array, bands: _Bands, base: float, slope: float
) -> tuple[Array, Array]:  # pragma: no cover - compiled
    n, count = len(points), len(bands.T)
    colors, weights = np.zeros((n, count, 3)), np.zeros((n, count))
    for p in range(n):
        for k in range(count):
            u, v, weight = _seen(points, normals, p, bands, k, base, slope)
            if weight > 0:
                weights[p, k] = weight
                _low_at(bands.low, k, u, v, colors[p], k)
    return colors, weights


@numba.njit(cache=True, nogil=True)
def _shade(
    points: Array, normals: Array, color: NDArray[np.uint8], bands: _Bands,
    gains: Array, group: NDArray[np.int64], among: NDArray[np.bool_], face: NDArray[np.int32],
    base: float, slope: float,
) -> tuple[F32, NDArray[np.uint8]]:  # pragma: no cover - compiled  # fmt: skip
    n, count = len(points), len(bands.T)
    out, views = np.zeros((n, 3), np.float32), np.zeros(n, np.uint8)
    at, weight, bright = np.empty((count, 2)), np.empty(count), np.empty(count)
    slow, which, order = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count, np.int64)
    fine, smooth, sharp = np.empty(3), np.empty(3), np.empty(3)
    for p in range(n):
        seen = 0
        for k in range(count):
            if not among[face[p], k]:
                continue
            u, v, good = _seen(points, normals, p, bands, k, base, slope)
            if good > 0:
                at[seen, 0], at[seen, 1], weight[seen], which[seen] = u, v, good, k
                _low_at(bands.low, k, u, v, slow, seen)
                for c in range(3):
                    slow[seen, c] *= gains[group[p], k, c]
                bright[seen] = (slow[seen, 0] + slow[seen, 1] + slow[seen, 2]) / 3.0
                seen += 1
        if seen == 0:
            continue
        usual = _weighted_median(bright, weight, order, seen)
        smooth[:] = 0.0
        total = 0.0
        for s in range(seen):
            weight[s] /= 1.0 + ((bright[s] - usual) / ODD) ** 4
            total += weight[s]
            for c in range(3):
                smooth[c] += weight[s] * slow[s, c]
        for c in range(3):
            smooth[c] /= total
        sharp[:] = 0.0
        total, most = 0.0, 0.0
        for _ in range(min(BEST, seen)):
            s = 0
            for k in range(1, seen):
                if weight[k] > weight[s]:
                    s = k
            good = weight[s]
            if good <= 0:
                break
            weight[s] = 0.0
            k = which[s]
            if not _detail_at(color, bands.which[k], bands.trust, k, at[s, 0], at[s, 1], fine):
                continue
            most = max(most, good)
            share = (good / most) ** SHARP
            for c in range(3):
                sharp[c] += share * (fine[c] * gains[group[p], k, c] - slow[s, c])
            total += share
        if total <= 0:
            continue
        views[p] = min(seen, 255)
        for c in range(3):
            out[p, c] = min(max(smooth[c] + sharp[c] / total, 0.0), 255.0)
    return out, views
