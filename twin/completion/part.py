"""The inferred layer of one moving part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.completion.board import Board
from twin.completion.cloud import OUT, Cloud
from twin.completion.frame import PartFrame, part_frame
from twin.completion.handle import Handle, find_handles
from twin.completion.hanging import without_floaters
from twin.completion.leaf import find_leaf
from twin.completion.room import Front
from twin.completion.shown import (
    passing,
    shown_surface,
    up_to,
    without_shreds,
    without_surroundings,
)
from twin.completion.tray import Tray, find_tray
from twin.completion.trimmed import trimmed
from twin.geometry import Array
from twin.inferred import PLAIN, Completion, Interior
from twin.scene import Box, Mesh, Part

_NEAR = 0.01  # m around a board within which seen vertices tell its colour
_FEW = 30  # vertices that tell none


def front_of(part: Part, eye: Array | None) -> Front | None:
    """The frame of a part and its front; None without a flat rectangle. eye: where the viewer stood (3,)."""
    frame = part_frame(part, eye)
    leaf = None if frame is None else find_leaf(Cloud.of(part.mesh, frame.T_world_frame))
    return None if frame is None or leaf is None else Front(frame, leaf)


def complete_part(
    part: Part, found: Front | None, rear_limit: float | None, eyes: Array | None
) -> Completion:
    """The inferred layer of a part, without collision shapes of what lies in no piece.

    Args:
        part: its seen mesh, joint and contact are read.
        found: its front; None where it has none, and then nothing is inferred.
        rear_limit: where (m along out, negative) the furniture ends behind the front, None where that was not
            seen.
        eyes: where the cameras stood (n, 3) as the part saw them at state 0; None without camera poses.
    """
    if found is None:
        return Completion(without_shreds(part.mesh))
    frame, leaf = found.frame, found.leaf
    front = leaf.board("front" if frame.kind == "drawer" else "panel")
    tray, boards = None, [front]
    if frame.kind == "drawer":
        T = frame.T_world_frame  # without what can't pass the opening, and without the front's skirt
        inside = Cloud.of(passing(shown_surface(part.mesh, [front], T, (), front), front, T), T)
        tray = find_tray(inside, leaf, rear_limit)
        boards += [b for b in tray.boards if not b.contradicted(inside)]
    return _layer(part.mesh, frame, boards, handles_of(part, found), tray, eyes)


def handles_of(part: Part, found: Front) -> list[Handle]:
    """Handles of a part before its front, in the front's frame, that which a hand held first."""
    to_frame, handle = geo.invert_pose(found.frame.T_world_frame), part.handle
    at = None if part.contact is None else geo.transform(to_frame, part.contact.point[None])[0]
    if handle is not None:
        handle = replace(handle, middle=geo.transform(to_frame, handle.middle[None])[0])
    cloud = Cloud.of(part.mesh, found.frame.T_world_frame)
    return find_handles(cloud, found.leaf, found.frame.noise, at, section=handle)


def _layer(
    mesh: Mesh,
    frame: PartFrame,
    boards: Sequence[Board],
    handles: Sequence[Handle],
    tray: Tray | None,
    eyes: Array | None,
) -> Completion:
    T = frame.T_world_frame
    blurred = [(h.low, h.high) for h in handles]
    bars = [b for h in handles for b in h.boards]
    pieces = [b.piece(T, color_near(mesh, b, T)) for b in (*boards, *bars)]
    interiors = []
    if tray is not None and np.all(tray.high - tray.low > 0.02):
        middle = geo.make_pose(translation=(tray.low + tray.high) / 2)
        interiors.append(Interior("inside", Box(T @ middle, tray.high - tray.low)))
    shown = shown_surface(mesh, boards, T, blurred, boards[0])
    if tray is None:
        shown = without_surroundings(shown, boards[0], T)
    elif tray.boards:
        shown = up_to(shown, min(float(b.low[OUT]) for b in tray.boards), T)
    if eyes is not None:
        shown = trimmed(shown, [b.box(T) for b in boards], eyes)
    shown = without_floaters(shown, [*boards, *bars], T)
    if tray is not None:
        shown = passing(shown, boards[0], T)
    return Completion(shown, tuple(pieces), (), tuple(interiors), kind=frame.kind)


def color_near(
    mesh: Mesh, board: Board, T_world_frame: Array, otherwise: NDArray[np.uint8] | None = None
) -> NDArray[np.uint8]:
    """Median colour (3,) of seen vertices around a board; where few lie there, `other` or all the mesh's."""
    if mesh.colors is None or not len(mesh.colors):
        return np.array(PLAIN, np.uint8) if otherwise is None else otherwise
    local = geo.transform(geo.invert_pose(T_world_frame), mesh.vertices)
    near = geo.every((local > board.low - _NEAR) & (local < board.high + _NEAR))
    told = int(near.sum()) > _FEW
    if not told and otherwise is not None:
        return otherwise
    return np.asarray(np.median(mesh.colors[near] if told else mesh.colors, axis=0)).astype(np.uint8)
