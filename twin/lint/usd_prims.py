"""What USD prims say: schemas, authored values, matrices, and the body that a prim belongs to."""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.geometry import Array
from twin.lint.model import WORLD


def enabled(attribute: Any) -> bool:
    return attribute.Get() is not False


def matrix_of(prim: Any, cache: Any) -> Array:
    """Local to world (4, 4) for column vectors; may hold scale."""
    return np.array(cache.GetLocalToWorldTransform(prim), dtype=np.float64).T


def scales(matrix: Array) -> Array:
    return np.linalg.norm(matrix[:3, :3], axis=0)


def body_of(prim: Any, rigid: set[Any]) -> str:
    while prim and not prim.IsPseudoRoot():
        if prim in rigid:
            return str(prim.GetPath())
        prim = prim.GetParent()
    return WORLD


def has(prim: Any, schema: str) -> bool:
    """Whether the file applies a schema. `HasAPI` also counts what another schema brings along, which depends
    on the plugins that this process has loaded: MuJoCo's collision schema brings UsdPhysics' with it."""
    return schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas()


def authored(attribute: Any) -> Any:
    return attribute.Get() if attribute and attribute.HasAuthoredValue() else None
