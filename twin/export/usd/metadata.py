"""Metadata of an asset as the SimReady profile wants it (requirement SR.004)."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime

import numpy as np

from twin.errors import InputError
from twin.export.tree import Tree
from twin.export.usd.layers import vec, world_origins
from twin.geometry import Array

FURNITURE = "Q14745"  # Wikidata's item for furniture
_EPOCH = "SOURCE_DATE_EPOCH"  # reproducible-builds.org/specs/source-date-epoch


def _date() -> str:
    """The date of $SOURCE_DATE_EPOCH, else 1970-01-01: a clock would make equal twins differ."""
    seconds = os.environ.get(_EPOCH, "0")
    try:
        return datetime.fromtimestamp(int(seconds), UTC).date().isoformat()
    except (ValueError, OverflowError, OSError) as e:
        raise InputError(
            f"${_EPOCH} is {seconds!r}, not a count of seconds", "unset it, or set it to a whole number"
        ) from e


@dataclass(frozen=True)
class AssetInfo:
    """What an asset says about itself beyond its content.

    date: ISO date; by default that of $SOURCE_DATE_EPOCH, else 1970-01-01. qcode: the Wikidata item of its kind.
    """

    author: str = "unknown"
    license: str = "unknown"
    category: str = "furniture"
    qcode: str = FURNITURE
    date: str = field(default_factory=_date)

    def __post_init__(self) -> None:
        for name in ("author", "license", "category"):
            if not getattr(self, name).strip():
                raise InputError(f"the asset's {name} is empty", "give a text, or leave it out")
        if not re.fullmatch(r"Q[0-9]+", self.qcode):
            raise InputError(f"{self.qcode!r} is not a Wikidata item", "give one like Q14745 (furniture)")
        try:
            date.fromisoformat(self.date)
        except ValueError as e:
            raise InputError(f"{self.date!r} is not a date", "give one like 2026-01-31") from e


def bounds(tree: Tree) -> Array | None:
    """Lowest and highest corner (2, 3) of what is drawn, in the world at state 0; None when nothing is."""
    origins = world_origins(tree)
    shown = [k.visual.vertices + origins[k.name] for k in tree.links if len(k.visual.vertices)]
    if not shown:
        return None
    return np.stack([np.min([p.min(0) for p in shown], 0), np.max([p.max(0) for p in shown], 0)])


def metadata(tree: Tree, info: AssetInfo, mass: float, runtimes: Mapping[str, str]) -> dict[str, object]:
    """The layer's custom data; mass in kg of all bodies together, runtimes: variant set -> file stem.

    The profile reads SimReady_Metadata (SR.004); the runtime features still ask for four fields beside it (SR.001).
    """
    box = bounds(tree)
    size = np.zeros(3) if box is None else box[1] - box[0]
    on = {r: {"prim": f"/{tree.name}", "variantSetName": r, "activateOption": "Enabled"} for r in runtimes}
    common = {
        "asset_name": tree.name,
        "asset_type": "prop",
        "source_file": tree.source,
        "usd_date_generated": info.date,
    }
    told = {
        **common,
        "asset_license": info.license,
        "author": info.author,
        "category": info.category,
        "qcode": info.qcode,
        "rigid_body_count": len(tree.links),
        "mass": mass,
        "asset_extents": vec(size),
        "Variants": {"Physics": on},
        "validation": {"profile": "Robotics-Prop", "profile_version": "4.0.0"},
    }
    return {**common, "SimReady_Metadata": told}
