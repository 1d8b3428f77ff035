"""Metadata of an asset as the SimReady profile wants it (requirement SR.004)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pxr import Vt

from twin.exporters.asset import AssetInfo
from twin.exporters.tree import Tree
from twin.exporters.usd.layers import vec, world_origins
from twin.geometry import Array
from twin.verdict import Verdict


def bounds(tree: Tree) -> Array | None:
    """Lowest and highest corner (2, 3) of what is drawn, in the world at state 0; None when nothing is."""
    origins = world_origins(tree)
    shown = [k.drawn + origins[k.name] for k in tree.links if len(k.drawn)]
    if not shown:
        return None
    return np.stack([np.min([p.min(0) for p in shown], 0), np.max([p.max(0) for p in shown], 0)])


def verdict_data(verdict: Verdict) -> dict[str, object]:
    """A verdict as a prim's custom data: its level, and a line for each reason."""
    lines = [f"{r.level}: {r.text}; {r.help}" for r in verdict.reasons]
    return {"level": verdict.level, "reasons": Vt.StringArray(lines)}


def metadata(tree: Tree, info: AssetInfo, runtimes: Mapping[str, str]) -> dict[str, object]:
    """The layer's custom data; runtimes: variant set -> file stem.

    The profile reads SimReady_Metadata (SR.004); runtime features still ask for four more fields (SR.001).
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
        "mass": float(sum(k.mass for k in tree.links)),
        "asset_extents": vec(size),
        "Variants": {"Physics": on},
        "validation": {"profile": "Robotics-Prop", "profile_version": "4.0.0"},
    }
    return {**common, "SimReady_Metadata": told}
