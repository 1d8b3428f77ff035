"""Functional digital twins: scene types, storage, physics, collision, export and checks."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from twin.errors import FuntwinError, InputError, MissingDependencyError

if TYPE_CHECKING:
    from twin.exporters import export
    from twin.importers import from_mjcf, from_urdf
    from twin.limits import with_limits
    from twin.page.notebook import show
    from twin.scene import (
        Box,
        ContactPath,
        Inertial,
        Joint,
        Mesh,
        Motion,
        Part,
        PartPhysics,
        Prismatic,
        Quantity,
        Revolute,
        StaticPart,
        Trajectory,
        Twin,
    )
    from twin.storage import load, save
    from twin.verdict import Verdict
    from twin.verification import check

__version__ = "0.1.0"

__all__ = [
    "Box",
    "ContactPath",
    "FuntwinError",
    "Inertial",
    "InputError",
    "Joint",
    "Mesh",
    "MissingDependencyError",
    "Motion",
    "Part",
    "PartPhysics",
    "Prismatic",
    "Quantity",
    "Revolute",
    "StaticPart",
    "Trajectory",
    "Twin",
    "Verdict",
    "check",
    "export",
    "from_mjcf",
    "from_urdf",
    "load",
    "save",
    "show",
    "with_limits",
]

# Modules are imported on first use: `import twin` stays light, and the command hears Ctrl-C at once.
_LAZY = {
    "Verdict": "twin.verdict",
    "check": "twin.verification",
    "export": "twin.exporters",
    "from_mjcf": "twin.importers",
    "from_urdf": "twin.importers",
    "load": "twin.storage",
    "save": "twin.storage",
    "show": "twin.page.notebook",
    "with_limits": "twin.limits",
    **dict.fromkeys(
        (
            "Box",
            "ContactPath",
            "Inertial",
            "Joint",
            "Mesh",
            "Motion",
            "Part",
            "PartPhysics",
            "Prismatic",
            "Quantity",
            "Revolute",
            "StaticPart",
            "Trajectory",
            "Twin",
        ),
        "twin.scene",
    ),
}

if not TYPE_CHECKING:  # a type checker that saw it would take every misspelled name for one that exists

    def __getattr__(name: str) -> Any:
        if name in _LAZY:
            return getattr(import_module(_LAZY[name]), name)
        raise AttributeError(f"module 'twin' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
