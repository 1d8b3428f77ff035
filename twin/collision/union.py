"""Bodies of one mesh that overlap, as in most CAD models, joined into one: their overlap counts once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from twin.collision.closed_pieces import outward
from twin.collision.decimation import decimated_body
from twin.collision.pieces import pieces_of
from twin.mesh import joined
from twin.scene import Mesh

# of all bodies, chosen by us: more are decimated, for the union of a million noisy faces takes minutes
_FACES = 20_000
OVERLAP = 0.001  # share of the bodies' volume, chosen by us: less is the rounding of boards that touch


@dataclass(frozen=True, eq=False)
class Union:
    """A mesh with its closed bodies joined, open pieces beside them; the share of volume that overlapped."""

    mesh: Mesh
    share: float


@lru_cache(maxsize=8)  # mass, and what is said of overlaps on export, ask for the same
def united(mesh: Mesh) -> Union | None:
    """The union of the closed bodies of a mesh (Manifold's exact-topology booleans); None with fewer than
    two, or where one passes through itself. Of large meshes, the union of bodies of fewer faces."""
    pieces = pieces_of(mesh)
    bodies = [piece for piece, closed in pieces if closed]
    if len(bodies) < 2:
        return None
    import manifold3d

    middle = mesh.vertices.mean(axis=0)
    solids = []
    for given_body in bodies:
        share = min(1.0, _FACES / len(mesh.faces))
        small = (
            decimated_body(given_body, max(500, int(share * len(given_body.faces))))
            if share < 1
            else given_body
        )
        body = None if small is None else outward(small)
        if body is None:
            return None
        given = manifold3d.Mesh64(
            np.ascontiguousarray(body.vertices - middle), np.ascontiguousarray(body.faces, dtype=np.uint64)
        )
        solid = manifold3d.Manifold(given)
        if solid.status() != manifold3d.Error.NoError:
            return None
        solids.append(solid)
    apart = sum(s.volume() for s in solids)
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError or not whole.num_tri() or apart <= 0:
        return None
    out = whole.to_mesh64()
    body = Mesh(np.asarray(out.vert_properties)[:, :3] + middle, np.asarray(out.tri_verts, dtype=np.int32))
    rest = [piece for piece, closed in pieces if not closed]
    return Union(joined([body, *rest]), max(0.0, 1.0 - float(whole.volume()) / apart))
