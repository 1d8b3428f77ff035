"""Photo textures: colours of all texels of static scene and parts, from labelled frames that show them best.

Charts (`charts`), the point of the body at each texel (`raster`), the photographs that show it (`photos`),
their exposure made equal (`exposure`), colours in two bands (`shade`), and plain colours where nothing was
seen (`fill`). After Lempitsky and Ivanov 2007, "Seamless mosaicing of image-based texture maps", and Allène,
Pons and Keriven 2008, who blend the bands of several views in place of one view a face.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.dense.noise import GOOD_SENSOR, DepthNoise
from recon.fusion.fuse import MAX_DEPTH
from recon.recording import Intrinsics, Recording
from recon.texture.charts import Layout, lay_out
from recon.texture.exposure import gains
from recon.texture.fill import around, over_surface
from recon.texture.photos import Photos, Shots, framed, of_body, take
from recon.texture.raster import MARGIN, faces_at, surface_at, vertex_normals
from recon.texture.shade import lows, shade
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.keys import Stage
from twin.runs.loop import Loop, untold
from twin.runs.setting import Settings, setting
from twin.runs.threads import each, threads
from twin.scene import STATIC_LABEL, Mesh, Revolute, Texture, Trajectory

TEXTURE = Stage("texture", 3, ("texture",))

# texels a pixel of the nearer photographs, chosen by us: sampling twice, in and out, blurs less
_PER_PIXEL = 1.4
_NEARER = 0.1  # share of the surface that is photographed finer than what the texel is made for
_PLACES = 3000  # points of a body, spread evenly over its vertices, in which photographs are compared
_GROW = 1.12  # of the texel, each time that the charts don't fit
FACINGS = 6  # ways that a side of a body may face
_AT_ONCE = 1 << 16  # texels or faces that a thread takes at a time: more take memory and no less time
_BLOCK = 0.5  # m: the static scene has one size of texel in each cube of so much
_STEP = float(np.sqrt(2.0))  # between two sizes of texel


@dataclass(frozen=True)
class TextureConfig(Settings):
    """How photo textures are made; chosen by us."""

    texel: float = setting(0.004, "largest texel, where the image has room for it", unit="m", above=0)
    most: int = setting(4096, "largest width and height of a texture", unit="px", at_least=64, at_most=16384)
    skip_every: int = setting(
        0,
        "every so many frames one is left out, to be compared with; 0 leaves none out",
        unit="frames",
        at_least=0,
    )


# m; smallest texel. Chosen by us.
_FINEST = 0.0005
# Most frames that are used, spread evenly. Chosen by us.
_MOST_FRAMES = 48
# Frames that show a part, beside these, in a recording of minutes. Chosen by us.
_OF_PART = 12


def photo_textures(
    recording: Recording,
    cameras: Trajectory,
    labels: Mapping[int, NDArray[np.uint8]],
    static: Mesh,
    parts: Sequence[FinishedPart],
    config: TextureConfig = TextureConfig(),
    noise: DepthNoise = GOOD_SENSOR,
    *,
    progress: Loop | None = None,
) -> dict[int, Texture]:
    """A texture of the static scene (key 1) and of each part (key: its id); bodies without faces have none.

    Args:
        labels: frame -> (H, W) label image; frames without a camera pose are left out.
        static: mesh in the world.
        parts: with their meshes at state 0.
        noise: of depth.
    """
    camera = recording.intrinsics
    frames = photographed([f for f in sorted(labels) if cameras.pose(f) is not None], labels, parts, config)
    shots = take(recording, cameras, labels, frames, MAX_DEPTH)
    bodies: dict[int, tuple[Mesh, FinishedPart | None]] = {STATIC_LABEL: (static, None)}
    bodies |= {p.moving.id: (p.mesh, p) for p in parts}
    bodies = {key: body for key, body in bodies.items() if len(body[0].faces)}
    photos = {key: _photos(shots, key, part, camera) for key, (_, part) in bodies.items()}
    equal = _gains(photos, bodies, noise)
    out = {}
    for key, (mesh, part) in (progress or untold)(list(bodies.items()), "textures"):
        texel = _texels(mesh, part, photos[key], config, noise)
        out[key] = _texture(mesh, part, texel, photos[key], equal[key], config, noise)
    return out


def photographed(
    frames: Sequence[int],
    labels: Mapping[int, NDArray[np.uint8]],
    parts: Sequence[FinishedPart],
    config: TextureConfig,
) -> list[int]:
    """The frames that are used; in a recording of several windows also some that show each part."""
    out = set(chosen(frames, config))
    for part in (p.moving for p in parts if p.moving.windows):
        out |= set(evenly([f for f in frames if np.any(labels[f] == part.id)], _OF_PART))
    return sorted(out)


def chosen(frames: Sequence[int], config: TextureConfig) -> list[int]:
    """The frames that are used, of those that are labelled."""
    skip = config.skip_every
    kept = [f for f in frames if not (skip and f % skip == 0)]
    return evenly(kept, _MOST_FRAMES)


def evenly(frames: Sequence[int], most: int) -> list[int]:
    """At most so many of the frames, spread evenly."""
    if len(frames) <= most:
        return list(frames)
    return [frames[k] for k in np.linspace(0, len(frames) - 1, most).round().astype(int)]


def _photos(shots: Shots, key: int, part: FinishedPart | None, camera: Intrinsics) -> Photos:
    poses = [np.eye(4) if part is None else part.moving.pose(f) for f in shots.frames]
    return of_body(shots, key, poses, camera)


def _gains(
    photos: Mapping[int, Photos], bodies: Mapping[int, tuple[Mesh, FinishedPart | None]], noise: DepthNoise
) -> dict[int, Array]:
    """Per body the gains (G, K, 3) of its photographs, for each way that its surface may face (`facing`).

    They are those of the whole frames, and for what turns, those of the light on each of its sides.
    """
    count = 1 + max((int(p.which.max()) for p in photos.values() if len(p.which)), default=-1)
    seen, groups = {}, {}
    for key, (mesh, part) in bodies.items():
        some = np.unique(np.linspace(0, len(mesh.vertices) - 1, _PLACES).round().astype(int))
        normals = vertex_normals(mesh.vertices, mesh.faces)[some]
        seen[key] = lows(mesh.vertices[some], normals, photos[key], noise)
        groups[key] = facing(normals, mesh, part)
    equal = gains([_spread(*seen[key], photos[key].which, count) for key in bodies], count)
    out = {}
    for key, (_, part) in bodies.items():
        of_frame = equal[photos[key].which]
        color, weight = seen[key]
        ways = [of_frame] * (1 if _still(part) else FACINGS)
        if not _still(part):
            mine = [groups[key] == g for g in range(FACINGS)]
            ways = [of_frame * gains([(color[m] * of_frame, weight[m])], len(of_frame)) for m in mine]
        out[key] = np.stack(ways)
    return out


def _spread(color: Array, weight: Array, which: NDArray[np.int64], count: int) -> tuple[Array, Array]:
    """Colours (n, K, 3) and weights (n, K) of a body's photographs among all `count` frames."""
    colors, weights = np.zeros((len(color), count, 3)), np.zeros((len(color), count))
    colors[:, which], weights[:, which] = color, weight
    return colors, weights


def _still(part: FinishedPart | None) -> bool:
    """Whether a body never turns, so that light falls on it from the same side."""
    return part is None or not isinstance(part.moving.joint, Revolute)


def facing(normals: Array, mesh: Mesh, part: FinishedPart | None) -> NDArray[np.int64]:
    """Which way (n,) 0..`FACINGS` - 1 surfaces with unit normals (n, 3) face: along the hinge, along the most
    common normal across it or along the third direction, to either side. All 0 for what never turns."""
    if part is None or _still(part):
        return np.zeros(len(normals), np.int64)
    axis = part.moving.joint.axis
    areas = geo.vector_areas(mesh.vertices[mesh.faces])
    across = areas - np.outer(areas @ axis, axis)
    spread = across.T @ (across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12))
    front = np.linalg.eigh(spread)[1][:, -1]
    along = normals @ np.stack([axis, front, np.cross(axis, front)], axis=1)
    best = np.abs(along).argmax(axis=1)
    return np.asarray(2 * best + (along[np.arange(len(normals)), best] < 0), dtype=np.int64)


def _texels(
    mesh: Mesh, part: FinishedPart | None, photos: Photos, config: TextureConfig, noise: DepthNoise
) -> Array:
    """Size (F,) m wanted of the texels of each face: by the pixels of the photographs that show it best, one
    size for a part and one for each `_BLOCK` of the static scene."""
    corners = mesh.vertices[mesh.faces]
    middle = corners.mean(axis=1)
    normals, area = geo.triangle_normals(corners)
    pixel = _finest_pixel(middle, normals, photos, noise)
    cells = np.zeros((len(middle), 3)) if part is not None else np.floor(middle / _BLOCK)
    _, block = geo.unique_rows(cells.astype(np.int64))
    order = np.lexsort((pixel, block))
    total, of = np.cumsum(area[order]), block[order]
    last = np.flatnonzero(np.diff(of, append=-1))
    before = np.concatenate([[0.0], total[last][:-1]])
    at = np.searchsorted(total, before + _NEARER * (total[last] - before))
    size = pixel[order][np.minimum(at, last)][block] / _PER_PIXEL
    finest = min(_FINEST, config.texel)
    steps = np.round(np.log(np.clip(size, finest, config.texel) / finest) / np.log(_STEP))
    return np.asarray(np.minimum(finest * _STEP**steps, config.texel))


def _finest_pixel(points: Array, normals: Array, photos: Photos, noise: DepthNoise) -> Array:
    """Size (n,) m on the body of a pixel of the photograph that shows a point best; infinite: none does."""

    def some(start: int) -> Array:
        part = slice(start, start + _AT_ONCE)
        _, weight = lows(points[part], normals[part], photos, noise)
        best = weight.max(axis=1, initial=0.0)
        return np.where(best > 0, 1.0 / np.sqrt(np.maximum(best, 1e-12)), np.inf)

    return np.concatenate([np.zeros(0), *each(some, range(0, len(points), _AT_ONCE))])


def _texture(
    mesh: Mesh,
    part: FinishedPart | None,
    texel: Array,
    photos: Photos,
    equal: Array,
    config: TextureConfig,
    noise: DepthNoise,
) -> Texture:
    """Charts, and the colour of each texel."""
    layout = _fitting(mesh, texel, config.most)
    height, width = layout.size
    normals = vertex_normals(mesh.vertices, mesh.faces)
    owner = _owners(layout)
    at_vertices = shade(mesh.vertices, normals, photos, equal, facing(normals, mesh, part), noise)
    plain = over_surface(at_vertices.color, at_vertices.views > 0, mesh.faces)
    around_face = 2 * MARGIN * float(texel.max())  # a texel beside a chart reads the plane of its face
    among = framed(mesh.vertices[mesh.faces], photos, around_face)
    image, mask = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), bool)
    rows, columns = np.nonzero(owner >= 0)

    def some(start: int) -> None:
        y, x = rows[start : start + _AT_ONCE], columns[start : start + _AT_ONCE]
        face = owner[y, x]
        points, ahead, inside = surface_at(layout.uv, face, y, x, mesh.vertices, mesh.faces, normals)
        shown = shade(points, ahead, photos, equal, facing(ahead, mesh, part), noise, (among, face))
        seen = shown.views > 0
        colors = shown.color
        colors[~seen] = np.einsum("nk,nkc->nc", inside[~seen], plain[mesh.faces[face[~seen]]])
        image[y, x], mask[y, x] = np.round(colors), seen

    for _ in each(some, range(0, len(rows), _AT_ONCE)):
        pass
    image = around(image, owner >= 0)
    return Texture((layout.uv / [width, height]).astype(np.float32), image[::-1], mask[::-1])


def _owners(layout: Layout) -> NDArray[np.int32]:
    """The face (height, width) of each texel, band by band."""
    height, width = layout.size
    step = -(-height // threads())
    bands = each(
        lambda first: faces_at(layout.uv, first, min(first + step, height), width), range(0, height, step)
    )
    return np.concatenate(list(bands))


def _fitting(mesh: Mesh, texel: Array, most: int) -> Layout:
    """Charts with texels as small as fit into an image of `most` px a side."""
    while True:
        layout = lay_out(mesh, texel)
        side = max(layout.size)
        if side <= most:
            return layout
        texel = texel * max(_GROW, side / most)
