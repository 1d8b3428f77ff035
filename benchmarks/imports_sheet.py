"""Pictures to judge an imported file by: source above export, each at rest, at all lower and at all upper
ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path

if sys.platform == "linux":
    os.environ.setdefault("MUJOCO_GL", "egl")  # read when MuJoCo is imported; pictures without a screen

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIDE = 320  # pixels
VIEWS = (-65.0, 25.0, 115.0, 205.0)  # azimuths in degrees: obliquely from all four sides


def sheet(source: Path, run: Path, to: Path) -> None:
    """Write the picture; nothing where MuJoCo reads neither file."""
    exported = [f for f in sorted((run / "export" / "mjcf").glob("*.xml")) if f.name != "scene.xml"]
    rows = [row for f in (source, *exported) for row in _rows(f)]
    if rows:
        Image.fromarray(np.concatenate(rows)).save(to)


def _rows(path: Path) -> list[NDArray[np.uint8]]:
    """Pictures (SIDE, 4 SIDE, 3) of a file at rest, at all lower and at all upper ends."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.4] * 3, [0.6] * 3
        model = spec.compile()
    except ValueError:
        return []
    data = mujoco.MjData(model)
    camera = _on_parts(model, data)
    limited = [j for j in range(model.njnt) if model.jnt_limited[j]]
    rows = []
    with mujoco.Renderer(model, SIDE, SIDE) as renderer:
        for end in (None, 0, 1):
            mujoco.mj_resetData(model, data)
            for j in limited if end is not None else []:
                data.qpos[model.jnt_qposadr[j]] = model.jnt_range[j, end]
            mujoco.mj_forward(model, data)
            rows.append(np.concatenate([_view(renderer, data, camera, v) for v in VIEWS], axis=1))
    return rows


def _on_parts(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjvCamera:
    """A camera that sees what moves at rest, and as much around it."""
    mujoco.mj_forward(model, data)
    moving = model.body_weldid[model.geom_bodyid] != 0
    centers, radii = data.geom_xpos[moving], model.geom_rbound[moving]
    camera = mujoco.MjvCamera()
    camera.lookat = (centers.min(axis=0) + centers.max(axis=0)) / 2
    camera.distance = 3.5 * float((np.linalg.norm(centers - camera.lookat, axis=1) + radii).max())
    camera.elevation = -25.0
    return camera


def _view(
    renderer: mujoco.Renderer, data: mujoco.MjData, camera: mujoco.MjvCamera, azimuth: float
) -> NDArray[np.uint8]:
    camera.azimuth = azimuth
    renderer.update_scene(data, camera)
    return np.array(renderer.render())
