"""Files that are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.lint_faults.planting import U_DRAWER, Mutations, Xml, set_

MUTATIONS = Mutations()
_add, _usd, _xml = MUTATIONS.add, MUTATIONS.usd, MUTATIONS.xml


@_xml("urdf", "path-absolute", "mesh")
def _(root: Xml, folder: Path) -> None:
    e = root.find(f"{U_DRAWER}/collision/geometry/mesh")
    e.set("filename", str((folder / e.get("filename")).resolve()))


@_xml("mjcf", "path-absolute", "texture")
def _(root: Xml, folder: Path) -> None:
    e = root.find("asset/texture")
    e.set("file", str((folder / "assets" / e.get("file")).resolve()))


@_usd("path-absolute", "texture")
def _(stage: Any, _: Path) -> None:
    a = _texture(stage)
    a.Set(str(Path(a.Get().resolvedPath).resolve()))


def _texture(stage: Any) -> Any:
    return next(
        a
        for p in stage.Traverse()
        for a in p.GetAttributes()
        if a.GetName() == "inputs:file" and a.Get() and "drawer" in a.Get().path
    )


_add("urdf", "path-missing", "mesh", set_(f"{U_DRAWER}/collision/geometry/mesh", filename="meshes/none.obj"))
_add("mjcf", "path-missing", "mesh", set_("asset/mesh[@name='drawer_collision_0']", file="none.obj"))
_add("usd", "path-missing", "texture", lambda stage, _: _texture(stage).Set("./textures/none.png"))


@_xml("urdf", "path-outside", "mesh")
def _(root: Xml, folder: Path) -> None:
    (folder / "meshes" / "drawer_collision_0.obj").rename(folder.parent / "drawer.obj")
    root.find(f"{U_DRAWER}/collision/geometry/mesh").set("filename", "../drawer.obj")


@_xml("mjcf", "path-outside", "mesh")
def _(root: Xml, folder: Path) -> None:
    (folder / "assets" / "drawer_collision_0.obj").rename(folder.parent / "drawer.obj")
    root.find("asset/mesh[@name='drawer_collision_0']").set("file", "../../drawer.obj")


@_usd("path-outside", "texture")
def _(stage: Any, folder: Path) -> None:
    a = _texture(stage)
    (folder.parent / "drawer.png").write_bytes(Path(a.Get().resolvedPath).read_bytes())
    a.Set("../drawer.png")
