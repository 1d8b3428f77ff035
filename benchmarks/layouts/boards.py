"""Pictures of a calibration board as two cameras on one device would take them, with exact truth.

Every pixel is the mean of `FINE` x `FINE` rays that meet the plane of a finely drawn board. The board's
pattern is OpenCV's drawing; the lens is solved here by Newton's method from the published formula, and
nothing is shared with the code that calibrates.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE = 3  # rays along a pixel's side
TEXELS = 60  # of the drawing along a square
GROUND = 110  # grey around the board


@dataclass(frozen=True)
class Camera:
    """A camera with OpenCV's eight coefficients k1 k2 p1 p2 k3 k4 k5 k6."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]

    def rays(self) -> Array:
        """(FINE height, FINE width, 2): x/z and y/z of every ray.

        Solved on a grid of pixels and between them linear, which is off by less than 1e-5 px.
        """
        u, v = (np.arange(-1, n + 1).astype(np.float64) for n in (self.width, self.height))
        bent = np.stack(np.meshgrid((u - self.cx) / self.fx, (v - self.cy) / self.fy))
        x, eps = bent.copy(), 1e-6
        for _ in range(6):  # Newton's method, the Jacobian by differences
            f = self.bend(x) - bent
            a = (self.bend(x + np.array([eps, 0.0])[:, None, None]) - f - bent) / eps
            b = (self.bend(x + np.array([0.0, eps])[:, None, None]) - f - bent) / eps
            det = a[0] * b[1] - b[0] * a[1]
            x = x - np.stack([b[1] * f[0] - b[0] * f[1], a[0] * f[1] - a[1] * f[0]]) / det
        return _between(_between(np.moveaxis(x, 0, -1), 0), 1)

    def bend(self, x: Array) -> Array:
        """Where the lens brings x/z, y/z (2, ...)."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        r = x[0] ** 2 + x[1] ** 2
        radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        u = x[0] * radial + 2 * p1 * x[0] * x[1] + p2 * (r + 2 * x[0] ** 2)
        v = x[1] * radial + p1 * (r + 2 * x[1] ** 2) + 2 * p2 * x[0] * x[1]
        return np.stack([u, v])


def _between(grid: Array, axis: int) -> Array:
    """A grid with a border, at FINE places a cell along an axis."""
    count = grid.shape[axis] - 2
    at = (np.arange(FINE * count) + 0.5) / FINE + 0.5  # from the border's middle
    low = np.floor(at).astype(np.int64)
    part = (at - low).reshape([-1 if a == axis else 1 for a in range(grid.ndim)])
    return np.asarray(np.take(grid, low, axis) * (1 - part) + np.take(grid, low + 1, axis) * part)


COLOR = Camera(800, 600, 610.0, 608.0, 405.0, 296.0, (0.11, -0.24, 0.0006, -0.0004, 0.12, 0.0, 0.0, 0.0))
DEPTH = Camera(640, 576, 503.0, 504.0, 322.0, 284.0, (-0.16, 0.05, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0))
SMALL_COLOR = Camera(480, 360, 366.0, 364.8, 243.0, 177.6, COLOR.distortion)
SMALL_DEPTH = Camera(400, 360, 314.0, 314.6, 201.0, 177.4, DEPTH.distortion)


def texture(
    columns: int, rows: int, dictionary: str | None = None, marker: float = 0.7, legacy: bool = False
) -> NDArray[np.uint8]:
    """A board drawn with TEXELS a square and a white border of one square; marker: part of the square."""
    if dictionary is None:
        black = np.indices((rows, columns)).sum(axis=0) % 2 == 0
        drawn: Any = np.kron(np.where(black, 0, 255), np.ones((TEXELS, TEXELS))).astype(np.uint8)
    else:
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}"))
        board = cv2.aruco.CharucoBoard((columns, rows), 1.0, marker, markers)
        board.setLegacyPattern(legacy)
        drawn = board.generateImage((columns * TEXELS, rows * TEXELS), marginSize=0, borderBits=1)
    return np.pad(np.asarray(drawn), TEXELS, constant_values=255)


def rotation(rotvec: tuple[float, float, float]) -> Array:
    """Rodrigues' formula."""
    w = np.asarray(rotvec)
    angle = float(np.linalg.norm(w))
    k = np.cross(np.eye(3), w / angle if angle else w)
    return np.asarray(np.eye(3) - np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


def pose(rotvec: tuple[float, float, float], translation: tuple[float, float, float]) -> Array:
    """(4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(rotvec), translation
    return T


def picture(
    rays: Array, T_camera_board: Array, drawn: NDArray[np.uint8], square: float, noise: float, seed: int
) -> tuple[NDArray[np.uint8], Array]:
    """A picture (H, W) and the depth (H, W) m of the board's plane at pixel centres, 0 beside the board."""
    h, w = (n // FINE for n in rays.shape[:2])
    top, left, bottom, right = _where(rays, T_camera_board, drawn.shape, square)
    part = rays[top * FINE : bottom * FINE, left * FINE : right * FINE]
    (x, y), z = _on_board(part, T_camera_board, square)
    fine = cv2.remap(
        drawn, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(GROUND,),
    )  # fmt: skip
    mean = np.full((h, w), float(GROUND))
    cells = fine.reshape(bottom - top, FINE, right - left, FINE)
    mean[top:bottom, left:right] = cells.mean(axis=(1, 3))
    mean = cv2.GaussianBlur(mean, (0, 0), 0.6) * 0.75 + 20.0
    noisy = mean + np.random.default_rng(seed).normal(0.0, noise, mean.shape)
    depth = np.zeros((h, w))
    on = (x > 0) & (y > 0) & (x < drawn.shape[1] - 1) & (y < drawn.shape[0] - 1)
    depth[top:bottom, left:right] = np.where(on, z, 0.0)[FINE // 2 :: FINE, FINE // 2 :: FINE]
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), depth


def _on_board(rays: Array, T: Array, square: float) -> tuple[tuple[Array, Array], Array]:
    """Column and row of the drawing that rays meet, and the depth there, m."""
    normal, origin = T[:3, 2], T[:3, 3]
    z = (normal @ origin) / (rays @ normal[:2] + normal[2])
    x, y = (rays[..., 0] * z * a[0] + rays[..., 1] * z * a[1] + z * a[2] - origin @ a for a in T[:3, :2].T)
    return ((x / square + 1.0) * TEXELS - 0.5, (y / square + 1.0) * TEXELS - 0.5), z


def _where(rays: Array, T: Array, shape: tuple[int, ...], square: float) -> tuple[int, int, int, int]:
    """Rows and columns (top, left, bottom, right) of pixels that see the board, with some around."""
    step = 4
    (x, y), _ = _on_board(rays[FINE // 2 :: FINE * step, FINE // 2 :: FINE * step], T, square)
    on = (x > 0) & (y > 0) & (x < shape[1]) & (y < shape[0])
    h, w = (n // FINE for n in rays.shape[:2])
    rows, columns = (step * np.flatnonzero(on.any(axis=a)) for a in (1, 0))
    return (
        max(0, int(rows[0]) - step), max(0, int(columns[0]) - step),
        min(h, int(rows[-1]) + 2 * step), min(w, int(columns[-1]) + 2 * step),
    )  # fmt: skip


def write_boards(
    out: Path,
    drawn: NDArray[np.uint8],
    square: float,
    T_color_depth: Array,
    count: int = 12,
    depth_scale: float = 1.0,
    noise: float = 1.0,
    cameras: tuple[Camera, Camera] = (COLOR, DEPTH),
) -> Path:
    """Write color/, infrared/ and depth/ (16-bit PNG, mm; measured = true / depth_scale) of a board held
    `count` times."""
    for name in ("color", "infrared", "depth"):
        (out / name).mkdir(parents=True)
    color, depth = (c.rays() for c in cameras)
    middle = np.array([drawn.shape[1] / TEXELS - 2.0, drawn.shape[0] / TEXELS - 2.0, 0.0]) * square / 2.0
    rng = np.random.default_rng(7)
    for k in range(count):
        turn = rng.uniform(-0.45, 0.45, 3) * (1.0, 1.0, 0.6)
        z = rng.uniform(0.24, 0.4)
        x, y = (0.28 * z * np.cos(2.4 * k), 0.2 * z * np.sin(2.4 * k))  # round the picture
        T = pose(tuple(turn), (0.0, 0.0, 0.0))
        T[:3, 3] = np.array([x, y, z]) - T[:3, :3] @ middle
        image, _ = picture(color, T, drawn, square, noise, 2 * k)
        infrared, z_map = picture(depth, np.linalg.inv(T_color_depth) @ T, drawn, square, noise, 2 * k + 1)
        millimetres = np.rint(1000.0 * z_map / depth_scale).astype(np.uint16)
        for folder, pixels in (("color", image), ("infrared", infrared), ("depth", millimetres)):
            cv2.imwrite(str(out / folder / f"{k:02d}.png"), pixels)
    return out
