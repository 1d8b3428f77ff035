"""Pictures to judge an imported file by: the source above, the exported MJCF below, each at both ends of every range and at rest."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIDE = 300
VIEWS = ((135.0, -25.0), (225.0, -25.0), (315.0, -25.0), (45.0, -25.0))


def sheet(source: Path, run: Path, to: Path) -> None:
    """Write the picture; nothing where neither file can be read by MuJoCo."""
    rows = [row for f in (source, *sorted((run / "export" / "mjcf").glob("*.xml"))) for row in _rows(f)]
    if rows:
        Image.fromarray(np.concatenate(rows)).save(to)


def _rows(path: Path) -> list[NDArray[np.uint8]]:
    """Four views of a file at rest, at the lower and at the upper ends: (3 SIDE, 4 SIDE, 3)."""
    if path.name.startswith("scene") or path.suffix != ".xml":
        return []
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.visual.global_.offwidth = spec.visual.global_.offheight = SIDE
        spec.worldbody.add_light(pos=[0, 0, 4], dir=[0, 0, -1], diffuse=[0.6] * 3)
        model = spec.compile()
    except ValueError:
        return []
    data = mujoco.MjData(model)
    limited = [j for j in range(model.njnt) if model.jnt_limited[j]]
    rows = []
    for end in (None, 0, 1):
        mujoco.mj_resetData(model, data)
        for j in limited if end is not None else []:
            data.qpos[model.jnt_qposadr[j]] = model.jnt_range[j, end]
        mujoco.mj_forward(model, data)
        rows.append(np.concatenate([_view(model, data, *v) for v in VIEWS], axis=1))
    return rows


def _view(model: mujoco.MjModel, data: mujoco.MjData, azimuth: float, elevation: float) -> NDArray[np.uint8]:
    camera = mujoco.MjvCamera()
    camera.lookat, camera.azimuth, camera.elevation = model.stat.center, azimuth, elevation
    camera.distance = 2.2 * model.stat.extent
    with mujoco.Renderer(model, SIDE, SIDE) as renderer:
        renderer.update_scene(data, camera)
        seen: NDArray[np.uint8] = renderer.render()
    return seen
