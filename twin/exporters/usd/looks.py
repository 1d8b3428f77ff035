"""Looks: a library of materials, their textures, and what is drawn with which."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics, UsdShade

from twin.exporters.obj import encoded, mean_color, textured_mesh
from twin.exporters.tree import Link, Tree, Visual
from twin.exporters.usd.layers import group_path, new_layer, scope_path, shape_materials

_LIBRARY = "MaterialsLibrary.usdc"
_UNKNOWN = "unknown"  # the material of a surface is not observed


def write_looks(tree: Tree, payload: Path, textures: Path) -> None:
    """Write MaterialsLibrary.usdc and Materials.usda (`payload`) and coloured links' images (`textures`)."""
    drawn = [(k, v, _look_name(k, v)) for k in tree.links for v in k.visuals]
    with new_layer(payload / _LIBRARY, "Materials", f"Looks of {tree.name}") as stage:
        UsdGeom.Scope.Define(stage, "/Materials")
        for link, shown, name in drawn:
            _look(stage, f"/Materials/{name}", link, shown, payload, textures)
    with new_layer(payload / "Materials.usda", tree.name, "Which look a shape is drawn with") as stage:
        stage.OverridePrim(f"/{tree.name}")
        if not tree.whole:
            UsdGeom.Scope.Define(stage, scope_path(tree, "Materials"))
        for link, shown, name in drawn:
            kept = shape_materials(stage, tree, link.name, "visuals")
            prim = stage.DefinePrim(f"{kept}/{name}")
            prim.GetReferences().AddReference(f"./{_LIBRARY}", f"/Materials/{name}")
            shape = stage.OverridePrim(f"{group_path(tree, link.name, 'visuals')}/{shown.name}")
            UsdShade.MaterialBindingAPI.Apply(shape).Bind(UsdShade.Material(prim))


def _look_name(link: Link, shown: Visual) -> str:
    return f"{link.name if shown.basis == 'seen' else shown.name}_look"


def _look(stage: Usd.Stage, path: str, link: Link, shown: Visual, payload: Path, textures: Path) -> None:
    """A rough surface with the link's texture (readers multiply it by the colour: white), else one colour."""
    image = textured_mesh(shown.mesh).baked.image
    plain = mean_color(shown.mesh) if shown.color is None else shown.color
    surface = define_surface(stage, path, plain if image is None else (1.0, 1.0, 1.0))
    if image is None:
        return
    textures.mkdir(exist_ok=True)
    file = textures / f"{_look_name(link, shown).removesuffix('_look')}.png"
    file.write_bytes(encoded(image))
    reader = UsdShade.Shader.Define(stage, f"{path}/coordinates")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Path(os.path.relpath(file, payload)).as_posix())
    # the standard takes 8-bit colour for sRGB, so MuJoCo does, too; when told "sRGB" it draws too dark
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("auto")
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    )
    surface.GetInput("diffuseColor").ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))


def define_surface(stage: Usd.Stage, path: str, color: tuple[float, float, float]) -> UsdShade.Shader:
    """Define a material with a rough UsdPreviewSurface of an sRGB colour in 0..1, and return its shader."""
    material = UsdShade.Material.Define(stage, path)
    UsdSemantics.LabelsAPI.Apply(material.GetPrim(), "material").CreateLabelsAttr([_UNKNOWN])
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*(c**2.2 for c in color)))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.7)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)  # MuJoCo warns when it is not authored
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return surface
