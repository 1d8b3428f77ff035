"""The asset's interface with its runtime variants, the payload's contents, and ready stages."""

from __future__ import annotations

from pathlib import Path

from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdSemantics

from twin.exporters.asset import AssetInfo
from twin.exporters.tree import Tree
from twin.exporters.usd.layers import new_layer, points
from twin.exporters.usd.metadata import bounds, metadata, verdict_data
from twin.exporters.usd.runtimes import RUNTIMES
from twin.names import unused


def write_contents(tree: Tree, payload: Path) -> None:
    """Write Contents.usda: the payload's layers, the strongest first."""
    with new_layer(payload / "Contents.usda", tree.name, f"All of {tree.name} but its interface") as stage:
        stage.GetRootLayer().subLayerPaths[:] = ["./Physics.usda", "./Materials.usda", "./Geometry.usda"]


def write_interface(tree: Tree, path: Path, info: AssetInfo) -> None:
    """Write the file that other scenes refer to: light, with everything heavy in the payload."""
    doc = (
        f"Functional digital twin {tree.name}: metres, kilograms, seconds; angles of joint limits in degrees"
    )
    with new_layer(path, tree.name, doc) as stage:
        root = UsdGeom.Xform.Define(stage, f"/{tree.name}").GetPrim()
        Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
        Usd.ModelAPI(root).SetAssetName(tree.name)
        Usd.ModelAPI(root).SetAssetIdentifier(Sdf.AssetPath(f"./{path.name}"))
        root.GetPayloads().AddPayload("./Payload/Contents.usda")
        box = bounds(tree)
        if box is not None:
            UsdGeom.ModelAPI.Apply(root).SetExtentsHint(points(box))
        UsdSemantics.LabelsAPI.Apply(root, "wikidata_qcode").CreateLabelsAttr([info.qcode])
        if tree.verdict is not None:  # on the prim, so that whoever refers to the asset has it too
            root.SetCustomDataByKey("verdict", verdict_data(tree.verdict))
        for runtime, stem in RUNTIMES.items():
            _variant(root, runtime, f"./runnables/physics/{stem}.usda")
        if any(k.grasp is not None for k in tree.links):
            _variant(root, "Grasps", "./runnables/grasps/grasps.usda")
        stage.GetRootLayer().customLayerData = metadata(tree, info, RUNTIMES)


def _variant(root: Usd.Prim, name: str, payload: str) -> None:
    """A variant set that is off by default and composes `payload` when it is on."""
    variants = root.GetVariantSets().AddVariantSet(name)
    for option in ("Disabled", "Enabled"):
        variants.AddVariant(option)
    variants.SetVariantSelection("Enabled")
    with variants.GetVariantEditContext():
        root.GetPayloads().AddPayload(payload)
    variants.SetVariantSelection("Disabled")


def write_stage(tree: Tree, path: Path, runtime: str, extra: str = "") -> None:
    """Write a stage that refers to the asset with one runtime on, and has the scene's gravity.

    extra: a further layer that overrides the asset, relative to the asset's folder.
    """
    with new_layer(path, tree.name, f"{tree.name} ready to simulate with the physics of {runtime}") as stage:
        root = UsdGeom.Xform.Define(stage, f"/{tree.name}").GetPrim()
        asset = f"./{tree.name}/simready_usd"
        for file in filter(None, (extra, f"{tree.name}.usda")):  # the first is the stronger one
            root.GetReferences().AddReference(f"{asset}/{file}")
        root.GetVariantSets().GetVariantSet(runtime).SetVariantSelection("Enabled")
        scene = UsdPhysics.Scene.Define(stage, f"/{unused('PhysicsScene', [tree.name])}")
        scene.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1))
        scene.CreateGravityMagnitudeAttr(9.81)
