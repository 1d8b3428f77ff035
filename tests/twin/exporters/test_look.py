"""What exported twins look like: their own colours, once, and a light that leaves them visible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from twin.exporters import export
from twin.exporters.visual import drawn
from twin.scene import Mesh, Twin

VIEWS = {
    "front": (-25, -10),
    "left": (65, -10),
    "right": (-115, -10),
    "above": (-25, -89),
    "oblique": (10, -35),
}
CLIPPED = 0.02  # share of a twin's pixels at 255
DIM, BRIGHT = 0.55, 1.0  # of the brightness that its colours have themselves


def painted(twin: Twin, color: tuple[int, int, int] | None) -> Twin:
    """The twin in one colour, or without any."""

    def paint(mesh: Mesh) -> Mesh:
        colors = None if color is None else np.tile(np.array([color], np.uint8), (len(mesh.vertices), 1))
        return replace(mesh, colors=colors)

    static = replace(twin.static, mesh=paint(twin.static.mesh))
    return replace(twin, static=static, parts=tuple(replace(p, mesh=paint(p.mesh)) for p in twin.parts))


TWINS = {
    "cabinet": cabinet_twin(nested=True, lid=True),
    "white kitchen": painted(cabinet_twin(lid=True), (255, 255, 255)),
    "random": random_twin(4),
}


def pictures(
    scene: Path,
) -> dict[str, tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.bool_]]]:
    """View -> picture, picture in the colours alone, and what of it is the twin."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    plain = mujoco.MjModel.from_xml_path(str(scene))
    plain.vis.headlight.ambient[:], plain.vis.headlight.diffuse[:] = 1.0, 0.0
    plain.light_active[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    floor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "floor")
    shots: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in VIEWS}
    for shown, segments in ((model, False), (plain, False), (model, True)):
        with mujoco.Renderer(shown, 240, 320) as renderer:
            if segments:
                renderer.enable_segmentation_rendering()
            for name, (azimuth, elevation) in VIEWS.items():
                camera = mujoco.MjvCamera()
                mujoco.mjv_defaultFreeCamera(model, camera)
                camera.azimuth, camera.elevation = model.vis.global_.azimuth + azimuth, elevation
                renderer.update_scene(data, camera)
                shots[name].append(renderer.render().copy())
    return {
        n: (lit, own, (seg[..., 0] >= 0) & (seg[..., 0] != floor)) for n, (lit, own, seg) in shots.items()
    }


@pytest.mark.parametrize("name", TWINS)
def test_the_scene_overexposes_nothing_and_leaves_nothing_dark_in_five_views(
    name: str, tmp_path: Path
) -> None:
    scene = export(TWINS[name], tmp_path, ["mjcf"])["mjcf"].with_name("scene.xml")
    for view, (lit, own, twin) in pictures(scene).items():
        assert twin.sum() > 100, view
        assert (lit[twin] == 255).any(axis=1).mean() <= CLIPPED, view
        assert DIM <= lit[twin].mean() / own[twin].mean() <= BRIGHT, view


def test_urdf_says_white_where_there_is_a_texture(tmp_path: Path) -> None:
    """PyBullet multiplies them: the mean colour beside the texture made a drawer half as bright."""
    twin = cabinet_twin()
    bare = painted(twin, None).static
    path = export(replace(twin, static=bare), tmp_path, ["urdf"])["urdf"]
    visuals = ET.parse(path).getroot().iter("visual")  # noqa: S314  (ours)
    colors = {v.get("name"): next(v.iter("color")).get("rgba") for v in visuals}
    white = "1.0 1.0 1.0 1.0"
    assert colors["door_visual"] == colors["drawer_visual"] == white
    assert colors["carcass_visual"] == "0.7059 0.7059 0.7059 1.0"
    for name, textured in (("door", True), ("drawer", True), ("carcass", False)):
        material = (path.parent / "meshes" / f"{name}_visual.mtl").read_text()
        assert ("map_Kd" in material) == textured


@pytest.mark.parametrize("stage_file", ["cabinet.usda", "cabinet_physx.usda"])
def test_the_ready_stages_show_every_mesh_in_its_own_colours(stage_file: str, tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    twin = cabinet_twin()
    twin = replace(twin, static=painted(twin, None).static)
    export(twin, tmp_path, ["usd"])
    stage = Usd.Stage.Open(str(tmp_path / "usd" / stage_file))
    for name, surface in [(twin.static.name, twin.static.mesh), *((p.name, p.mesh) for p in twin.parts)]:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/cabinet/{name}/{name}_visual"))
        told = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor")
        assert told.HasAuthoredValue()
        assert UsdGeom.Gprim(mesh).GetDisplayColorAttr().Get() is not None
        want = drawn(surface).colors
        got = np.array(told.ComputeFlattened())
        if want is None:
            assert told.GetInterpolation() == "constant"
            want = np.array([[180, 180, 180]], np.uint8)
        else:
            assert told.GetInterpolation() == "vertex"
        assert np.allclose(got, (want / 255.0) ** 2.2, atol=1e-4)
