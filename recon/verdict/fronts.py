"""Whether a slide has a front: a drawer goes along its normal, to which refinement draws the axis."""

from __future__ import annotations

import numpy as np

from recon.interaction.refine.ties import ASKEW
from twin import geometry as geo
from twin.scene import Joint, Mesh

# Share of the surface that is front. Of seven short drawers that depth alone tells and that are within the
# limit of refinement (looked at) all were right, .3 to 1.5 deg off
FRONT = 0.3
_FACING = np.radians(15.0)  # of the normals that are taken for the front's; chosen by us


def square_to_front(joint: Joint, mesh: Mesh | None) -> bool:
    """Whether a joint's axis is along the mean normal of a mesh's faces about square to it, if large."""
    if mesh is None or not len(mesh.faces):
        return False
    normals, area = geo.triangle_normals(mesh.vertices[mesh.faces])
    cosine = normals @ joint.axis
    front = np.abs(cosine) > np.cos(_FACING)
    if float(area[front].sum()) < FRONT * float(area.sum()):
        return False
    mean = (np.sign(cosine) * area)[front] @ normals[front]
    return geo.line_angle(mean, joint.axis) <= ASKEW
