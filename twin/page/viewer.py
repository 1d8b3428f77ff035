"""The scene of the page: the twin as glTF and what the page's own scripts play, and three.js to draw it."""

from __future__ import annotations

import base64
import zipfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.completion.asset import AssetView
from twin.errors import SceneError
from twin.exporters.asset import AssetInfo
from twin.exporters.glb import glb
from twin.exporters.tree import build_tree, link_origin, started
from twin.report.film import film
from twin.report.frames import axis_line, part_color
from twin.report.plots import unit
from twin.report.replayed import rounded
from twin.report.views import View, overview, part_view
from twin.scene import Part, Twin

_SCRIPTS = ("orbit.js", "scene.js", "measure.js", "clock.js", "replays.js", "viewer.js")
_LIVE = ("edits.js", "say.js")
_AS_RECORDED = AssetView("complete", "keep", "camera")
_LAST = "THREE.GLTFLoader=GLTFLoader;})();"  # of the library in trimesh's page; its own code follows
# of a picture for a screen that is wider than high; only the direction of view is taken
_ASPECT = (640, 480)
_NEAREST = 0.3  # m from the eye to what it turns about; chosen by us
_WIDER = 1.4  # than the parts in all their states: what stands beside them is seen as well


def scene_glb(twin: Twin) -> str:
    """The twin as a .glb in base64, every layer and the collision shapes in it.

    Raises SceneError for a twin that can't be shown as it moves, as one with an empty range.
    """
    from twin.physics import with_physics

    ready = with_physics(_AS_RECORDED.of(twin))
    return base64.b64encode(glb(build_tree(ready), AssetInfo(), light=True, shapes=True)).decode()


def scene_document(run: Path | None, twin: Twin, replays: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """What the scripts play, JSON types: parts with states, cameras, film, replays and the first view.
    Lengths in m, angles in rad, times in s from the first camera, those of a replay from its begin."""
    start = started(twin)
    return {
        "parts": [_part(p, start) for p in twin.parts],
        "cameras": _cameras(twin, start),
        "film": film(run, twin, start) if run is not None else {"frames": []},
        "replays": list(replays),
        "view": _view(
            part_view(twin, twin.parts, *_ASPECT) if twin.parts else overview(twin, *_ASPECT), twin
        ),
    }


def _part(part: Part, start: float) -> dict[str, Any]:
    joint, motion = part.joint, part.motion
    to_link = -link_origin(part)
    told: dict[str, Any] = {
        "name": part.name,
        "color": "#{:02x}{:02x}{:02x}".format(*part_color(part)),
        "unit": unit(part),
        "scale": 180.0 / np.pi if joint.kind == "revolute" else 1000.0,
        "lower": joint.lower,
        "upper": joint.upper,
        "times": rounded(motion.times - start),
        "states": rounded(motion.state),
        "axis": rounded(axis_line(part) + to_link),
    }
    if part.contact is not None:
        held = np.isin(motion.frames, part.contact.frames)
        told["contact"] = rounded(part.contact.point + to_link)
        told["held"] = rounded((motion.times - start)[held])
    return told


def _cameras(twin: Twin, start: float) -> dict[str, Any]:
    if twin.cameras is None:
        return {}
    poses = twin.cameras.T_world_cam
    return {
        "times": rounded(twin.cameras.times - start),
        "positions": rounded(poses[:, :3, 3]),
        "quaternions": rounded(np.roll(geo.quat_wxyz_from_matrix(poses[:, :3, :3]), -1, axis=-1)),
    }


def _view(view: View, twin: Twin) -> dict[str, Any]:
    """Where one looks from at first: eye and target (3,) m, and the vertical angle of view in degrees."""
    eye, forward = view.T_world_cam[:3, 3], view.T_world_cam[:3, 2]
    middles = [p.mesh.area_centroid for p in twin.parts if len(p.mesh.faces)]
    distance = max([float((np.mean(middles, axis=0) - eye) @ forward) if middles else 0.0, _NEAREST])
    upright = 2.0 * np.arctan(_WIDER * np.tan(view.fov / 2) * view.height / view.width)
    return {
        "eye": rounded(eye),
        "target": rounded(eye + distance * forward),
        "fov": round(float(np.rad2deg(upright)), 3),
    }


@cache
def scripts(live: bool) -> str:
    """The page's own scripts. live: with that which edits the twin."""
    folder = Path(__file__).parent / "scripts"
    return "\n".join((folder / name).read_text(encoding="utf-8") for name in (*_SCRIPTS, *_LIVE * live))


@cache
def three_js() -> str:
    """three.js and its reader of glTF, as trimesh ships them for its own viewer (MIT licence).

    Raises SceneError where a version of trimesh ships them otherwise.
    """
    import trimesh

    path = Path(trimesh.__file__).parent / "resources" / "templates" / "viewer.zip"
    try:
        with zipfile.ZipFile(path) as archive:
            page = archive.read("viewer.html.template").decode()
        begin = page.index("/**", page.index("<script>"))
        return page[begin : page.index(_LAST, begin) + len(_LAST)]
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as e:
        problem = f"trimesh {trimesh.__version__} ships no viewer with three.js ({e})"
        raise SceneError(problem, "install the version of constraints.txt") from e
