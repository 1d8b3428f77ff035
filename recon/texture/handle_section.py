"""A handle's thickness by its outline in photographs: a fused surface makes 15 to 35 mm of a 12 mm bar.

Each photograph without a hand near is laid onto the plane of the handle's outer face and told row by row
along the handle, which leaves a profile of colour across it. A bar that is as deep as wide shows its front
there, beside it from aside its flank, `tan` of the angle times as wide, and what lies behind to both sides:
four strips of one colour each. The width at which such strips explain the profiles of all photographs best is
the handle's, where no other width does nearly as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from recon.recording import Recording
from recon.texture.photo_textures import evenly
from twin import geometry as geo
from twin.completion.cloud import OUT, SIDE, UP
from twin.completion.eyes import states_of
from twin.completion.frame import viewer
from twin.completion.handle import Handle
from twin.completion.part import front_of, handles_of
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.threads import each
from twin.scene import HAND_LABEL, HandleSection, Part, Twin

HANDLE = Stage("handle", 1, ())

# Chosen by us; the last two on recordings of random furniture whose results were looked at.
WIDTHS = np.arange(0.006, 0.0425, 0.0005)  # m, of handles
_STEP = 0.0005  # m between the samples of a profile
_SHIFT = 0.014  # m that the handle may lie beside where the fused surface has it
_REACH = 0.045  # m to both sides of a profile
# m: least half width of what is explained, and what of it lies beside the fused surface
_AROUND = 0.025, 0.012
_ROWS = 40
_MIDDLE = 0.7  # of the length that is looked at: posts stand at the ends
_ASIDE = np.radians(55.0)  # from how far aside, across the handle, a photograph still tells
_ALONG = np.radians(65.0)  # from how far aside, along it
_HAND = 0.03  # of the picture's width around a hand that a photograph doesn't tell in
_VIEWS = 4  # photographs, at least
_MOST = 24  # photographs, at most
_OTHER = 0.004  # m: widths that differ by more are others
# by which -2 log likelihood must be less than that of all others, colours normal around each strip's
_SURE = 100.0


@dataclass(frozen=True, eq=False)
class Profile:
    """Colours (n, 3) across a handle, `_STEP` m apart, seen `angle` rad aside; a pixel is `pixel` m there."""

    color: Array
    angle: float
    pixel: float


def handle_sections(twin: Twin, recording: Recording) -> dict[int, HandleSection]:
    """Part id -> section of its handle, for parts with one that photographs tell of.

    twin: with labels, cameras, and its parts' meshes and motions.
    """
    eye, out = viewer(twin.cameras), {}
    for part in twin.parts:
        front = front_of(part, eye)
        found = [] if front is None else handles_of(part, front)
        if front is None or not found:
            continue
        T = front.frame.T_world_frame
        profiles = profiles_of(part, found[0], T, twin, recording)
        fused = _across(found[0])
        width = width_of(profiles, float((found[0].high - found[0].low)[fused]))
        if width is not None:
            bar = found[0].boards[0]
            middle = np.array([*((bar.low + bar.high) / 2)[:OUT], bar.high[OUT]])
            out[part.id] = HandleSection(geo.transform(T, middle[None])[0], width, len(profiles))
    return out


def with_handles(twin: Twin, sections: Mapping[int, HandleSection]) -> Twin:
    """The twin with the sections of its parts' handles, by part id."""
    return replace(twin, parts=tuple(replace(p, handle=sections.get(p.id)) for p in twin.parts))


def _across(handle: Handle) -> int:
    size = handle.boards[0].size
    return UP if size[SIDE] >= size[UP] else SIDE


def profiles_of(
    part: Part, handle: Handle, T_world_frame: Array, twin: Twin, recording: Recording
) -> list[Profile]:
    """Profiles across a handle, from the photographs in which no hand is near it; frames spread evenly."""
    bar, across = handle.boards[0], _across(handle)
    along, middle = SIDE + UP - across, (bar.low + bar.high) / 2
    grid = np.empty((_ROWS, 2 * round(_REACH / _STEP) + 1, 3))
    grid[..., across] = middle[across] + _STEP * (np.arange(grid.shape[1]) - grid.shape[1] // 2)
    reach = 0.5 * _MIDDLE * float(bar.size[along])
    grid[..., along] = middle[along] + np.linspace(-reach, reach, _ROWS)[:, None]
    grid[..., OUT] = bar.high[OUT]
    points = geo.transform(T_world_frame, grid.reshape(-1, 3))
    states = states_of(twin)

    def seen(frame: int) -> Profile | None:
        pose = None if twin.cameras is None else twin.cameras.pose(frame)
        if pose is None:
            return None
        T_body_cam = geo.invert_pose(twin.part_pose(part.id, states(frame))) @ pose
        eye = geo.transform(geo.invert_pose(T_world_frame), T_body_cam[None, :3, 3])[0] - grid.mean(
            axis=(0, 1)
        )
        aside, off = np.arctan2(eye[[across, along]], eye[OUT])
        if abs(aside) > _ASIDE or abs(off) > _ALONG:
            return None
        lit = _sampled(geo.transform(geo.invert_pose(T_body_cam), points), grid.shape, frame, twin, recording)
        pixel = float(np.linalg.norm(eye)) / recording.intrinsics.fx
        return None if lit is None else Profile(np.median(lit, axis=0), float(aside), pixel)

    frames = evenly([f for f in sorted(twin.labels) if part.id in states(f)], _MOST)
    return [p for p in each(seen, frames) if p is not None]


def _sampled(
    points: Array, shape: tuple[int, ...], frame: int, twin: Twin, recording: Recording
) -> Array | None:
    """Colours (rows, n, 3) of a frame at its camera's points (rows * n, 3); None out of view, near a hand."""
    camera = recording.intrinsics
    if points[:, 2].min() < 0.1:
        return None
    u = camera.fx * points[:, 0] / points[:, 2] + camera.cx
    v = camera.fy * points[:, 1] / points[:, 2] + camera.cy
    if min(u.min(), v.min()) < 1 or u.max() > camera.width - 2 or v.max() > camera.height - 2:
        return None
    x, y = (k.reshape(shape[:2]).astype(np.float32) for k in (u, v))
    size = 2 * round(_HAND * camera.width) + 1
    hand = cv2.dilate((twin.labels[frame] == HAND_LABEL).astype(np.uint8), np.ones((size, size), np.uint8))
    if np.any(cv2.remap(hand, x, y, cv2.INTER_NEAREST)):
        return None
    return np.asarray(cv2.remap(recording.color(frame), x, y, cv2.INTER_CUBIC), np.float64)


def width_of(profiles: list[Profile], fused: float) -> float | None:
    """Width (m) of a handle by profiles across it, or None. fused: its width (m) in the fused surface."""
    if len(profiles) < _VIEWS:
        return None
    half = min(_REACH, max(_AROUND[0], fused / 2 + _AROUND[1]))
    misfit = np.sum([_misfit(p, half) for p in profiles], axis=0)
    best = int(np.argmin(misfit))
    others = np.abs(WIDTHS - WIDTHS[best]) > _OTHER
    sure = misfit[others].min() - misfit[best] > _SURE
    return float(WIDTHS[best]) if sure and 0 < best < len(WIDTHS) - 1 else None


def _misfit(profile: Profile, half: float) -> Array:
    """-2 log likelihood (widths,) of one profile within `half` m, handle at its best; pixels are samples."""
    n = 2 * round(half / _STEP) + 1
    start = len(profile.color) // 2 - n // 2
    color = profile.color[start : start + n]
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(color, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum((color**2).sum(axis=1))])
    middles = np.arange(-_SHIFT, _SHIFT + _STEP / 2, _STEP)
    low = middles[None] - WIDTHS[:, None] / 2
    flank = WIDTHS[:, None] * np.tan(abs(profile.angle))
    ends = [low, low + WIDTHS[:, None], low + WIDTHS[:, None] + flank]
    if profile.angle < 0:
        ends = [low - flank, low, low + WIDTHS[:, None]]
    at = [np.clip(np.round(e / _STEP).astype(int) + n // 2, 0, n) for e in ends]
    at = [np.zeros_like(at[0]), *at, np.full_like(at[0], n)]
    error = np.zeros(low.shape)
    for a, b in pairwise(at):
        total = sums[b] - sums[a]
        error += squares[b] - squares[a] - (total**2).sum(axis=-1) / np.maximum(b - a, 1)
    fit = n * np.log(np.maximum(error, 1e-6) / n)
    return np.asarray(fit.min(axis=1)) * _STEP / profile.pixel
