"""Units, masses and inertias."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.lint_faults.planting import (
    M_DRAWER,
    U_DOOR,
    U_DRAWER,
    Mutations,
    attr,
    drop,
    meta,
    prim,
    set_,
)

MUTATIONS = Mutations()
_add, _usd = MUTATIONS.add, MUTATIONS.usd

# units
_add("usd", "units-kilograms", "missing", meta("kilogramsPerUnit", None))
_add("usd", "units-kilograms", "grams", meta("kilogramsPerUnit", 0.001))
_add("usd", "units-metres", "missing", meta("metersPerUnit", None))
_add("usd", "units-metres", "centimetres", meta("metersPerUnit", 0.01))


def _other_layer(key: str, value: Any) -> Callable[[Any, Path], None]:
    """Set metadata of a layer that the stage is made of."""

    def change(stage: Any, _: Path) -> None:
        layer = sorted(
            (k for k in stage.GetUsedLayers() if not k.anonymous and k != stage.GetRootLayer()),
            key=lambda k: k.GetDisplayName(),
        )[0]
        layer.pseudoRoot.SetInfo(key, value)
        layer.Save()

    return change


_add("usd", "units-kilograms", "a layer in grams", _other_layer("kilogramsPerUnit", 0.001))
_add("usd", "units-metres", "a layer in centimetres", _other_layer("metersPerUnit", 0.01))
_add("usd", "up-axis", "a layer with Y", _other_layer("upAxis", "Y"))
_add("usd", "up-axis", "missing", meta("upAxis", None))
_add("usd", "up-axis", "Y", meta("upAxis", "Y"))
_add("urdf", "number-unreadable", "mass in words", set_(f"{U_DRAWER}/inertial/mass", value="heavy"))
_add("urdf", "number-unreadable", "axis of two numbers", set_(f"{U_DOOR}/axis", xyz="0 1"))

# mass and inertia
_add("urdf", "mass-missing", "no inertial", drop(f"{U_DRAWER}/inertial"))
_add("mjcf", "mass-missing", "no inertial", drop(f"{M_DRAWER}/inertial"))


@_usd("mass-missing", "no mass")
def _(stage: Any, _: Path) -> None:
    from pxr import UsdPhysics

    prim(stage, "/drawer").RemoveAPI(UsdPhysics.MassAPI)


for _value in ("0", "-3", "nan"):
    _add("urdf", "mass-value", _value, set_(f"{U_DRAWER}/inertial/mass", value=_value))
    _add("mjcf", "mass-value", _value, set_(f"{M_DRAWER}/inertial", mass=_value))
    _add("usd", "mass-value", _value, attr("/drawer", "physics:mass", float(_value)))
_add("urdf", "inertia-missing", "mass alone", drop(f"{U_DRAWER}/inertial/inertia"))
_add("usd", "inertia-missing", "mass alone", attr("/drawer", "physics:diagonalInertia", None))
_add("urdf", "inertia-positive", "negative", set_(f"{U_DRAWER}/inertial/inertia", ixx="-0.1"))
_add("mjcf", "inertia-positive", "negative", set_(f"{M_DRAWER}/inertial", fullinertia="-0.1 0.1 0.1 0 0 0"))
_add(
    "usd",
    "inertia-positive",
    "negative",
    attr("/drawer", "physics:diagonalInertia", lambda v: type(v)(-v[0], v[1], v[2])),
)
_add("urdf", "inertia-triangle", "one moment tenfold", set_(f"{U_DRAWER}/inertial/inertia", izz="2.7"))
_add(
    "mjcf",
    "inertia-triangle",
    "one moment tenfold",
    set_(f"{M_DRAWER}/inertial", fullinertia="0.13 0.16 2.7 0 0 0"),
)
_add(
    "usd",
    "inertia-triangle",
    "one moment tenfold",
    attr("/drawer", "physics:diagonalInertia", lambda v: type(v)(v[0], v[1], 10 * v[2])),
)


@_usd("body-scale", "body stretched")
def _(stage: Any, _: Path) -> None:
    from pxr import Gf, UsdGeom

    UsdGeom.Xformable(prim(stage, "/drawer")).AddScaleOp().Set(Gf.Vec3f(1, 1.2, 1))
