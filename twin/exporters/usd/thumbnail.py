"""A thumbnail of the closed twin, as file browsers show it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from twin import geometry as geo
from twin.exporters.obj import encoded
from twin.exporters.tree import Tree, Visual, front
from twin.exporters.usd.layers import world_origins
from twin.report.meshes import draw_meshes
from twin.report.views import look_at
from twin.scene import Mesh

_SIZE = 256  # pixels, as SimReady's requirement SR.002 names the folder
_AWAY = 2.2  # distance of the eye, in sizes of what moves
_LEFT = 0.45  # how far beside the front the eye stands, per metre before it
_UP = 0.35  # how far above the front the eye stands, per metre before it


def colored(mesh: Mesh, shown: Visual) -> Mesh:
    """A mesh with the plain colour of what is drawn, where that has one."""
    if shown.color is None:
        return mesh
    color = np.round(np.array(shown.color) * 255).astype(np.uint8)
    return Mesh(mesh.vertices, mesh.faces, np.tile(color, (len(mesh.vertices), 1)))


def write_thumbnail(tree: Tree, path: Path) -> None:
    """Draw the twin from in front of its parts, cast ray by ray so that equal twins give equal pictures."""
    path.parent.mkdir(parents=True)
    origins = world_origins(tree)
    meshes = [
        colored(v.mesh.transformed(geo.make_pose(translation=origins[k.name])), v)
        for k in tree.links
        for v in k.visuals
    ]
    moving = [k.drawn + origins[k.name] for k in tree.links if k.joint is not None and k.visuals]
    shown = np.concatenate([*(moving or [m.vertices for m in meshes]), np.zeros((0, 3))])
    if not len(shown):
        shown = np.zeros((1, 3))
    low, high = shown.min(axis=0), shown.max(axis=0)
    target, reach = (low + high) / 2, float(np.linalg.norm(high - low)) + 0.1
    ahead = front(tree)
    side = np.cross([0.0, 0.0, 1.0], ahead)
    eye = target + _AWAY * reach * geo.unit(ahead + _LEFT * side + [0.0, 0.0, _UP])
    path.write_bytes(encoded(draw_meshes(meshes, look_at(eye, target, shown, _SIZE, _SIZE))))
