"""Labels of all windows together: a part that stands open in another window is no wall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dense import looks
from recon.interaction.interaction import Interaction
from recon.interaction.parts.moving_part import MovingPart
from recon.merge.merge import Merged
from recon.merge.same_part import CELL_M
from recon.recording import Recording
from recon.windows.windows import Window
from twin import geometry as geo
from twin.runs.threads import each
from twin.scene import STATIC_LABEL, UNKNOWN_LABEL, Trajectory

# m by which a pixel may lie before or behind the part's surface: drift of the cameras, and a handle.
_GATE_M = 0.04
# Labelled pixels are looked at in blocks of so many on each side.
_EVERY = 2
# Gaps between cells that are closed, in such blocks.
_BLOCK = np.ones((3, 3), np.uint8)
# s between frames outside of all windows that show the static scene.
_CONTEXT_S = 1.0


def all_labels(
    recording: Recording, cameras: Trajectory, interactions: Sequence[Interaction], merged: Merged
) -> Mapping[int, NDArray[np.uint8]]:
    """Label images (H, W) by frame of the recording: of the windows, and of some frames between them.

    One window's labels stay as they are. Else a pixel of the static scene, or of what carries the part, that
    lies on the surface of a part that the window does not handle, in the state that it has there, is that
    part's.
    """
    if len(interactions) == 1 and interactions[0].window.is_whole(recording):
        return interactions[0].labels
    told = {
        f + i.window.first: (image, number)
        for number, i in enumerate(interactions)
        for f, image in i.labels.items()
    }
    shape = recording.intrinsics.height, recording.intrinsics.width
    static = np.full(shape, STATIC_LABEL, np.uint8)
    for frame in _between(recording, cameras, [i.window for i in interactions]):
        told[frame] = (static, -1)
    frames = sorted(told)

    def label(frame: int) -> NDArray[np.uint8]:
        image, number = told[frame]
        standing = [
            k for k, shares in enumerate(merged.shares) if all(s.interaction != number for s in shares)
        ]
        return _with_standing(image, frame, recording, cameras, merged, standing)

    return dict(zip(frames, each(label, frames), strict=True))


def _between(recording: Recording, cameras: Trajectory, windows: Sequence[Window]) -> list[int]:
    """Posed frames outside of all windows, `_CONTEXT_S` apart."""
    times = np.asarray(recording.times)
    out: list[int] = []
    for f in cameras.frames.tolist():
        if any(w.first <= f <= w.last for w in windows):
            continue
        if not out or times[f] - times[out[-1]] >= _CONTEXT_S:
            out.append(int(f))
    return out


def _with_standing(
    image: NDArray[np.uint8],
    frame: int,
    recording: Recording,
    cameras: Trajectory,
    merged: Merged,
    standing: Sequence[int],
) -> NDArray[np.uint8]:
    """A label image with the parts that stand around, by their places."""
    T_world_cam = cameras.pose(frame)
    depth = np.asarray(recording.depth(frame), np.float32)
    out = np.where(depth > 0, image, image if image.min() != image.max() else UNKNOWN_LABEL).astype(np.uint8)
    if T_world_cam is None:
        return out
    c, seen = recording.intrinsics, depth[::_EVERY, ::_EVERY]
    block = np.zeros(seen.shape, np.uint8)
    below = {k: _below(merged.parts[k]) for k in standing}
    for k in sorted(standing, key=lambda k: len(below[k])):  # what is carried lies on its carrier
        part, surface = merged.parts[k], merged.surfaces[k]
        pose = part.pose(frame)
        if pose is None or not len(surface):
            continue
        T = geo.invert_pose(T_world_cam) @ pose
        z = looks.drawn(surface, CELL_M, T, out.shape, _EVERY, (c.fx, c.fy, c.cx, c.cy))
        block[_whole((seen > 0) & (np.abs(seen - z) < _GATE_M), seen > 0)] = part.id
    large = np.repeat(np.repeat(block, _EVERY, axis=0), _EVERY, axis=1)[: out.shape[0], : out.shape[1]]
    for k, ids in below.items():
        out[(large == merged.parts[k].id) & np.isin(out, ids)] = merged.parts[k].id
    return out


def _whole(there: NDArray[np.bool_], known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pixels (h, w) of a surface without gaps, with those of unknown depth within its outline: a plain
    front has depth at its edges alone."""
    closed = cv2.morphologyEx(there.astype(np.uint8), cv2.MORPH_CLOSE, _BLOCK)
    solid = cv2.morphologyEx(closed, cv2.MORPH_OPEN, _BLOCK)
    outline = np.zeros_like(solid)
    if solid.any():
        cv2.fillConvexPoly(outline, cv2.convexHull(cv2.findNonZero(solid)), 1)
    return np.asarray((closed > 0) | (~known & (outline > 0)))


def _below(part: MovingPart) -> list[int]:
    """Labels that pixels of a part have in a window which doesn't handle it."""
    return [UNKNOWN_LABEL, STATIC_LABEL, *([] if part.carrier is None else [part.carrier.id])]
