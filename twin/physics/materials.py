"""The table of materials: densities, board thickness, friction and joint resistance, with sources.

FunREC, supplement 4: a table in place of a model.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from twin.errors import ConfigError, SceneError, nearest_name
from twin.files.assets import asset
from twin.files.paths import AnyPath
from twin.quantities import Catch, Quantity, origin_of

_JOINTS = ("revolute", "prismatic")


@dataclass(frozen=True)
class Material:
    """Density kg/m^3, board thickness m and sliding friction."""

    name: str
    density: Quantity
    thickness: Quantity
    friction: Quantity


@dataclass(frozen=True)
class JointLaw:
    """How joints of one type resist. friction: share of weight x lever; decay: s until speed is 1/e."""

    friction: Quantity
    decay: Quantity


@dataclass(frozen=True)
class MaterialTable:
    """Materials by name, the default one, and how joints resist by type ("revolute", "prismatic").

    catches: by type of joint, what other furniture was measured to be held by; an unmeasured type has none.
    """

    default: str
    materials: Mapping[str, Material]
    joints: Mapping[str, JointLaw]
    catches: Mapping[str, Catch] = field(default_factory=dict)

    def material(self, name: str) -> Material:
        """The material of that name. Raises ConfigError with the nearest name."""
        if name not in self.materials:
            close = nearest_name(name, list(self.materials))
            hint = f"did you mean {close!r}? " if close else ""
            raise ConfigError(
                f"material {name!r} is not in the table", hint + f"known: {', '.join(self.materials)}"
            )
        return self.materials[name]


def read_materials(path: AnyPath | None = None) -> MaterialTable:
    """Read a table of materials (TOML), by default the one that ships, assets/materials.toml.

    Raises ConfigError naming file and entry; InputError when the one that ships is missing.
    """
    path = asset("materials.toml") if path is None else Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as e:
        raise ConfigError(
            f"table of materials {path} can't be read: {e}", "start from assets/materials.toml"
        ) from e
    try:
        materials = {
            name: Material(name, *(_quantity(row[k]) for k in ("density", "thickness", "friction")))
            for name, row in data["materials"].items()
        }
        joints = {
            k: JointLaw(*(_quantity(data["joints"][k][q]) for q in ("friction", "decay"))) for k in _JOINTS
        }
        catches = {
            k: Catch(_quantity(row["force"], "typical"), _quantity(row["width"], "typical"))
            for k, row in data.get("catches", {}).items()
        }
        return MaterialTable(materials[data["default"]].name, materials, joints, catches)
    except (KeyError, TypeError, SceneError) as e:
        raise ConfigError(f"table of materials {path}: {e}", "start from assets/materials.toml") from e


def _quantity(row: Mapping[str, Any], word: str = "default") -> Quantity:
    """A number of the table; what its source does not call measured is a default, or what the word says."""
    low, high = row["interval"]
    source = str(row["source"])
    source = (
        source if origin_of(source) == "measured" else f"{word}: {source.removeprefix(f'{word}:').strip()}"
    )
    return Quantity(float(row["value"]), source, (float(low), float(high)))
