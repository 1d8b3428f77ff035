"""What of a twin an exported asset shows: which layer, with the room or without, and in which frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.errors import InputError
from twin.files.text import read_json, write_json
from twin.geometry import Array
from twin.inferred import Completion
from twin.placed import placed
from twin.scene import Mesh, Twin

Geometry = Literal["seen", "bounded", "complete"]
Room = Literal["keep", "drop"]
Place = Literal["furniture", "camera"]
FILE = "asset.json"
_LEVEL = 0.7  # of a unit direction upwards, above which a front lies like a lid
_FORMAT = "funtwin-asset/1"


@dataclass(frozen=True)
class AssetView:
    """What an exported asset shows of a twin.

    geometry: "seen": what cameras saw; "bounded": with what is inferred and bounded by what was seen;
    "complete": with what is assumed. room: whether other things stay. origin: "furniture": on the floor under
    the first part's front, x to its right, y into the furniture; "camera": the twin's own world.
    """

    geometry: Geometry = "complete"
    room: Room = "drop"
    origin: Place = "furniture"

    def __post_init__(self) -> None:
        for name, known in (("geometry", Geometry), ("room", Room), ("origin", Place)):
            value = getattr(self, name)
            if value not in get_args(known):
                raise InputError(
                    f"{name} {value!r} is not known", f"choose from {', '.join(get_args(known))}"
                )

    def but(self, fields: Mapping[str, str | None]) -> AssetView:
        """The view with fields given by name. Raises InputError for a word not known."""
        said: dict[str, Any] = {k: v for k, v in fields.items() if v is not None}
        return replace(self, **said)

    @property
    def plain(self) -> bool:
        """Whether it is the twin as it was seen, where it was seen."""
        return self == AS_SEEN

    def of(self, twin: Twin) -> Twin:
        """The twin to be written. It has an inferred layer already where the geometry asks for one."""
        shown = self._layers(twin)
        return shown if self.origin == "camera" else placed(shown, self.pose(twin))

    def _layers(self, twin: Twin) -> Twin:
        if self.geometry == "seen":
            mesh, layer = _as_seen(twin, twin.static.mesh), twin.static.completion
            static = replace(twin.static, mesh=mesh, completion=None)
            if self.room == "drop" and layer is not None and layer.room is not None:
                static = replace(static, mesh=_without(mesh, layer.room), collision=())
            parts = tuple(replace(p, mesh=_as_seen(twin, p.mesh), completion=None) for p in twin.parts)
            return replace(twin, static=static, parts=parts)

        def layer_of(layer: Completion | None, seen: Mesh) -> Completion | None:
            if layer is None:
                return None
            if self.geometry == "bounded":
                from twin.completion.bounded import bounded  # SciPy, which a wrong option needs not wait for

                layer = bounded(layer, seen)
            return replace(layer, room=None, room_collision=()) if self.room == "drop" else layer

        static = replace(twin.static, completion=layer_of(twin.static.completion, twin.static.mesh))
        parts = tuple(replace(p, completion=layer_of(p.completion, p.mesh)) for p in twin.parts)
        return replace(twin, static=static, parts=parts)

    def pose(self, twin: Twin) -> Array:
        """T_asset_twin (4, 4): from the twin's world (robots' trajectories) into the asset's."""
        return np.eye(4) if self.origin == "camera" else asset_pose(twin)

    def write(self, twin: Twin, folder: Path) -> None:
        """Write FILE into the folder of an export; the plain view of a twin without catches needs none."""
        caught = {
            p.name: p.physics.catch
            for p in twin.parts
            if p.physics is not None and p.physics.catch is not None
        }
        if not self.plain or caught:
            told = {"format": _FORMAT, **asdict(self), "T_asset_twin": self.pose(twin).tolist()}
            told |= {"catches": {name: asdict(catch) for name, catch in caught.items()}} if caught else {}
            write_json(folder / FILE, told)


AS_SEEN = AssetView("seen", "keep", "camera")


def usual_view(twin: Twin) -> AssetView:
    """How a twin is exported unless somebody says otherwise: complete, apart from the room, in the
    furniture's frame. A twin without a verdict is whole as stated and stays where it is."""
    return AssetView() if is_reconstructed(twin) else AS_SEEN


def is_reconstructed(twin: Twin) -> bool:
    """Whether a twin was made from a recording, and so shows what cameras saw: stated ones have none."""
    return twin.recorded is not None and twin.verdict is not None


def view_of(files: Iterable[Path]) -> AssetView:
    """What exported files show of their twin. Raises InputError if they differ or FILE can't be read."""
    found = {_read(file.parent) for file in files}
    if len(found) > 1:
        raise InputError(
            "the exported formats show different things of the twin", "run twin export for all formats again"
        )
    return found.pop() if found else AS_SEEN


def _read(folder: Path) -> AssetView:
    path = folder / FILE
    if not path.is_file():
        return AS_SEEN
    told: Mapping[str, Any] = read_json(path)
    try:
        return AssetView(told["geometry"], told["room"], told["origin"])
    except KeyError as e:
        raise InputError(f"{path} does not say {e}", "run twin export again") from e


def asset_pose(twin: Twin) -> Array:
    """T_asset_twin (4, 4): from the twin's world into that of an asset in the furniture's frame.

    The origin is on the floor, or below what is lowest where no floor was seen, under the middle of the first
    part's front; x points to the right of who stands before it, y into the furniture, z up. The identity for
    a twin without parts.
    """
    if not twin.parts:
        return np.eye(4)
    from twin.completion.frame import part_frame, viewer  # SciPy, which a wrong option needs not wait for

    part = twin.parts[0]
    frame = part_frame(part, viewer(twin.cameras))
    middle = part.mesh.area_centroid if len(part.mesh.faces) else np.zeros(3)
    out = frame.T_world_frame[:3, 2] if frame is not None else np.array([0.0, -1.0, 0.0])
    if frame is not None and abs(out[2]) > _LEVEL:  # a lid: who opens it stands before its free edge
        out = -frame.T_world_frame[:3, 1]
    level = out * [1.0, 1.0, 0.0]
    level = geo.unit(level) if np.linalg.norm(level) > 1e-6 else np.array([0.0, -1.0, 0.0])
    rotation = np.stack([np.cross(-level, [0.0, 0.0, 1.0]), -level, [0.0, 0.0, 1.0]], axis=1)
    # from the middle out to the front's plane
    if frame is not None and abs(frame.T_world_frame[2, 2]) <= _LEVEL:
        middle = middle + ((frame.T_world_frame[:3, 3] - middle) @ out) * out
    origin = np.array([*middle[:2], _lowest(twin)])
    return geo.invert_pose(geo.make_pose(rotation, origin))


def _lowest(twin: Twin) -> float:
    """Height (m) of the floor: nearly the lowest of what was seen."""
    meshes = [m for m in (twin.static.mesh, *(p.mesh for p in twin.parts)) if len(m.vertices)]
    return float(np.quantile(np.concatenate([m.vertices for m in meshes])[:, 2], 0.002)) if meshes else 0.0


def _as_seen(twin: Twin, mesh: Mesh) -> Mesh:
    """A reconstruction's mesh without photographs (made for the inferred layer); a stated mesh as it is."""
    return replace(mesh, texture=None) if is_reconstructed(twin) else mesh


def _without(mesh: Mesh, room: Mesh) -> Mesh:
    """The triangles of a mesh that are not among those of another, which were taken from it."""
    rows = np.ascontiguousarray(mesh.vertices[mesh.faces].reshape(-1, 9))
    others = np.ascontiguousarray(room.vertices[room.faces].reshape(-1, 9))
    return mesh.of(~_among(rows, others))


def _among(rows: Array, others: Array) -> NDArray[np.bool_]:
    kind = np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))
    return np.isin(rows.view(kind).ravel(), others.view(kind).ravel())
