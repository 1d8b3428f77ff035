"""What inferred pieces wear: the photographs of what was seen on them, and elsewhere those of their like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.atlas import BORDER, MOST_TEXELS, shelves
from twin.completion.board import INSET
from twin.completion.eyes import part_eyes, static_eyes
from twin.completion.photographed import FEW, TEXEL, Face, Seen, blank, filled, tile_of
from twin.completion.trimmed import within
from twin.geometry import Array
from twin.inferred import Completion, Inferred, box_mesh
from twin.scene import Box, Mesh, Texture, Twin

# m^2 of a face that must have been seen to tell what its like look like. Chosen by us: a square of 10 cm.
_TELLS = 0.01
# m by which a piece with photographs is drawn outside its faces: the seen surface, whose photographs it
# wears, ends ragged and lies behind it. As far as a plain one is drawn inside.
_OUTSET = INSET
# Distance of two sRGB colours of 0..255 that may stand for each other. Chosen by us: wood in two lights.
_ALIKE = 60.0
# Largest distance (m) of two boards' faces in one plane. Chosen by us: less than a board is thick.
_FLUSH = 0.002
# Share of a face in that of a larger board with which it counts as a part of that one. Chosen by us.
_MOSTLY = 0.5
# m around a handle within which a scan is blurred (twin.completion.shown has as much around a board).
_BLUR = 0.020


@dataclass(frozen=True, eq=False)
class _Textured:
    """A piece with its six faces, in the order of `_faces`, the tile of its most seen one, None where none
    was seen enough, and its colour (3,), None where too little was. before: which faces stand before what was
    seen, and not in another's; no face that is assumed and was not seen."""

    piece: Inferred
    faces: tuple[Face, ...]
    tile: NDArray[np.float32] | None
    color: Array | None
    before: tuple[bool, ...]

    @property
    def area(self) -> float:
        """m^2 that was seen of the most seen face."""
        return max(f.area for f in self.faces)


def worn(twin: Twin) -> Twin:
    """The twin whose inferred pieces wear photographs, where its bodies have some.

    A texel that no photograph shows is marked in the texture's mask, and a piece of which none shows anything
    says in its reason whose picture it wears. Handles keep a plain colour, being slimmer than seen.
    """
    bodies = [(twin.static.mesh, twin.static.completion, static_eyes(twin))]
    bodies += [(p.mesh, p.completion, part_eyes(twin, p)) for p in twin.parts]
    dressed = [_textured_pieces(*body) for body in bodies]
    fronts = [d for body in dressed[1:] for d in body if d.piece.role in ("front", "panel")]
    layers = [
        layer if layer is None or not body else _with_looks(layer, body, fronts)
        for (_, layer, _), body in zip(bodies, dressed, strict=True)
    ]
    parts = tuple(replace(p, completion=k) for p, k in zip(twin.parts, layers[1:], strict=True))
    return replace(twin, static=replace(twin.static, completion=layers[0]), parts=parts)


def _textured_pieces(mesh: Mesh, layer: Completion | None, eyes: Array | None) -> list[_Textured]:
    """The pieces of a body with what was seen of them; none where the body has no photographs."""
    if layer is None or eyes is None or mesh.texture is None or not len(mesh.faces) or not layer.pieces:
        return []
    texel, seen = _texel(layer.pieces), Seen(mesh, eyes)
    boards = [board_of(p) for p in layer.pieces if p.role != "handle"]
    blurred = _blurred([p for p in layer.pieces if p.role == "handle"])
    out = []
    for piece in layer.pieces:
        faces, board = [blank(*where, texel) for where in _faces(piece.mesh)], board_of(piece)
        if piece.role == "handle":
            out.append(_Textured(piece, tuple(faces), None, None, (False,) * 6))
            continue
        others = [b for b in boards if not np.array_equal(b.T_world_box, board.T_world_box)]
        larger = [b for b in others if _width(b) > _width(board)]
        faces = [seen.on(f, partial(_in_any, [*others, *blurred], -_FLUSH)) for f in faces]
        flush = [f.where(partial(_in_any, larger, _FLUSH)) for f in faces]
        own = [replace(f, seen=f.seen & ~m) for f, m in zip(faces, flush, strict=True)]
        most = max(own, key=lambda f: f.area)
        tile = tile_of(most) if most.area > _TELLS else None
        unseen = [piece.basis == "assumed" and f.area < _TELLS for f in faces]
        before = tuple(bool(m.mean() < _MOSTLY) and not u for m, u in zip(flush, unseen, strict=True))
        out.append(_Textured(piece, tuple(faces), tile, _color_of(most), before))
    return out


def _color_of(face: Face) -> Array | None:
    """Median colour (3,) of what was seen of a face; None where too little was."""
    return np.asarray(np.median(face.color[face.seen], axis=0), np.float64) if face.seen.sum() > FEW else None


def _width(board: Box) -> float:
    """m^2 of a board's largest face."""
    return float(np.sort(board.size)[1:].prod())


def _in_any(boards: Sequence[Box], margin: float, points: Array) -> NDArray[np.bool_]:
    """Whether points (n, 3) lie in one of the boards, or less than `margin` m outside it."""
    out = np.zeros(len(points), bool)
    reach = 2.0 * abs(margin)  # of a turned box's corners, too
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    for b in boards:
        if np.all(b.corners.max(axis=0) > low) and np.all(b.corners.min(axis=0) < high):
            out |= within(b, points, margin)
    return out


def _blurred(pieces: Sequence[Inferred]) -> list[Box]:
    """The boxes around handles, bar and posts together, in which a scan is blurred."""
    out = []
    for bar in (p for p in pieces if not any(p.name.startswith(f"{q.name}_") for q in pieces)):
        T = board_of(bar).T_world_box
        own = [p.mesh.vertices for p in pieces if p is bar or p.name.startswith(f"{bar.name}_")]
        local = geo.transform(geo.invert_pose(T), np.concatenate(own))
        low, high = local.min(axis=0) - _BLUR, local.max(axis=0) + _BLUR
        out.append(Box(T @ geo.make_pose(translation=(low + high) / 2), high - low))
    return out


def _texel(pieces: Sequence[Inferred]) -> float:
    """m that a texel of a body's pieces is wide, so that all fit into one image."""
    area = sum(p.mesh.area for p in pieces)
    return max(TEXEL, float(np.sqrt(area / (0.5 * MOST_TEXELS**2))))


def _faces(box: Mesh) -> list[tuple[Array, Array, Array, Array]]:
    """Corner, sides across and up, outward normal of a `box_mesh` box's faces: two along each axis.

    Upright faces have plumb for their side up, level ones the box's last axis: grain runs one way on all.
    """
    v = box.vertices
    axes = [v[4] - v[0], v[2] - v[0], v[1] - v[0]]
    plumb = int(np.argmax([abs(a[2]) for a in axes]))
    out = []
    for k in range(3):
        i, j = (n for n in range(3) if n != k)
        across, up = (j, i) if i == plumb else (i, j)
        for sign in (-1, 1):
            corner = v[0] if sign < 0 else v[0] + axes[k]
            start = corner if axes[up][2] >= 0 else corner + axes[up]
            rise = axes[up] if axes[up][2] >= 0 else -axes[up]
            out.append((start, axes[across], rise, sign * geo.unit(axes[k])))
    return out


def _like(textured: _Textured, body: Sequence[_Textured], fronts: Sequence[_Textured]) -> _Textured | None:
    """Whose picture a piece wears: its own where enough of it was seen, else that of the piece that it goes
    on from, of what is nearest in colour, or, where none of it was seen, of its kind, of the fronts, of the
    most seen. None where no colour is near."""
    if textured.tile is not None:
        return textured
    shown = sorted((d for d in body if d.tile is not None), key=lambda d: -d.area)
    akin = [d for d in shown if _goes_on(textured, d)]
    color = textured.color
    options = [*shown, *fronts]
    if akin or color is None:
        kind = [d for d in shown if d.piece.role == textured.piece.role]
        return next(iter([*akin, *kind, *fronts, *shown]), None)
    near = min(options, key=lambda d: _color_distance(d, color), default=None)
    return near if near is not None and _color_distance(near, color) < _ALIKE else None


def _color_distance(textured: _Textured, color: Array) -> float:
    return np.inf if textured.color is None else float(np.linalg.norm(textured.color - color))


def _goes_on(one: _Textured, other: _Textured) -> bool:
    """Whether one of two pieces goes on from the other, by their names."""
    a, b = one.piece.name, other.piece.name
    return a.startswith(f"{b}_") or b.startswith(f"{a}_")


def _color(textured: _Textured, face: int, body: Sequence[_Textured]) -> Array | None:
    """Colour (3,) of a face of a piece of which nothing was seen: of the same face of a piece that it goes on
    from or that goes on from it, else of the piece itself, of such another, or of one of its kind."""
    others = [d for d in body if d is not textured]
    akin = [d for d in others if _goes_on(textured, d)]
    kind = [d for d in others if d.piece.role == textured.piece.role]
    options = [*(_color_of(d.faces[face]) for d in akin), *(d.color for d in (textured, *akin, *kind))]
    return next((c for c in options if c is not None), None)


def _with_looks(layer: Completion, body: Sequence[_Textured], fronts: Sequence[_Textured]) -> Completion:
    """The layer whose pieces wear their pictures."""
    likes = [None if d.piece.role == "handle" else _like(d, body, fronts) for d in body]
    pictures = [_pictures(d, like, body) for d, like in zip(body, likes, strict=True)]
    image, seen, places = _packed(
        [p for own in pictures for p in own], [f.seen for d in body for f in d.faces]
    )
    pieces = []
    for k, (textured, like, own) in enumerate(zip(body, likes, pictures, strict=True)):
        told = like is None or like is textured
        reason = "" if told or like is None else f"; wears the picture of {like.piece.name}, tiled"
        largest = max(own, key=lambda p: p.size)
        color = np.asarray(np.round(largest.reshape(-1, 3).mean(axis=0)), np.uint8)
        piece = replace(textured.piece, reason=f"{textured.piece.reason}{reason}", color=color)
        pieces.append(
            replace(piece, mesh=_covered(piece, textured.before, places[6 * k : 6 * k + 6], image, seen))
        )
    return replace(layer, pieces=tuple(pieces))


def _pictures(
    textured: _Textured, like: _Textured | None, body: Sequence[_Textured]
) -> list[NDArray[np.uint8]]:
    """The pictures of a piece's six faces, with the tile of its like, in the light of what was seen of it."""
    tile, own = None if like is None else like.tile, textured.piece.color.astype(np.float64)
    out = []
    for k, face in enumerate(textured.faces):
        color = None if textured.piece.role == "handle" else _color(textured, k, body)
        out.append(filled(face, tile, color, own if color is None else color))
    return out


def board_of(piece: Inferred) -> Box:
    """The board that a piece stands for, which is drawn inside its faces."""
    v = piece.mesh.vertices
    axes = np.stack([v[4] - v[0], v[2] - v[0], v[1] - v[0]], axis=1)
    size = np.linalg.norm(axes, axis=0)
    return Box(geo.make_pose(axes / size, v.mean(axis=0)), size + 2 * INSET)


def _packed(
    pictures: Sequence[NDArray[np.uint8]], masks: Sequence[NDArray[np.bool_]]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], Array]:
    """One image, top row first, its mask, and each picture's place (n, 4): left, bottom, width, height."""
    size = np.array([p.shape[1::-1] for p in pictures])
    at, _ = shelves(size + 2 * BORDER)
    wide, high = (at + size + 2 * BORDER).max(axis=0)
    image, seen = np.zeros((high, wide, 3), np.uint8), np.zeros((high, wide), bool)
    around = (BORDER, BORDER)
    for picture, mask, (w, h), (x, y) in zip(pictures, masks, size, at, strict=True):
        frame = np.s_[y : y + h + 2 * BORDER, x : x + w + 2 * BORDER]
        image[frame] = np.pad(picture, (around, around, (0, 0)), mode="edge")
        seen[frame] = np.pad(mask, (around, around), mode="edge")
    places = np.column_stack([(at + BORDER) / [wide, high], size / [wide, high]])
    frozen, mask = image[::-1].copy(), seen[::-1].copy()
    frozen.flags.writeable = mask.flags.writeable = False
    return frozen, mask, places


def _covered(
    piece: Inferred,
    before: Sequence[bool],
    places: Array,
    image: NDArray[np.uint8],
    seen: NDArray[np.bool_],
) -> Mesh:
    """The mesh of a piece with its texture, drawn outside its faces before what was seen."""
    board = board_of(piece)
    out = np.where(before, _OUTSET, -INSET).reshape(3, 2)
    middle = geo.make_pose(translation=(out[:, 1] - out[:, 0]) / 2)
    mesh = box_mesh(board.T_world_box @ middle, board.size + out.sum(axis=1), piece.color)
    uv = np.zeros((12, 3, 2), np.float32)
    corners = piece.mesh.vertices[mesh.faces]
    normals = geo.triangle_normals(corners)[0]
    for (corner, across, up, normal), (x, y, w, h) in zip(_faces(piece.mesh), places, strict=True):
        own = normals @ normal > 0.5
        local = corners[own] - corner
        uv[own] = np.stack(
            [x + w * (local @ across) / (across @ across), y + h * (local @ up) / (up @ up)], axis=-1
        )
    return replace(mesh, texture=Texture(np.clip(uv, 0, 1), image, seen))
