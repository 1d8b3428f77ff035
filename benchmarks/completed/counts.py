"""Counters of judged assets: rates and medians of many follow from their sums, and nothing of a single clip
is left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

# Bars, most of them shares
FULL, FULL_REAR, CARCASS, INFERRED_OFF, THROUGH = 0.75, 0.85, 0.50, 0.05, 0.005
HANDLE_OFF, GAP = 0.004, 0.70  # m; share
PART_SHAPES, FURNITURE_SHAPES, OUTSIDE_MM = 24, 40, 6.0
RATIO, RATIO_TWO_FACES = (0.75, 1.3), (0.9, 1.15)
BALLS = 12
BIN = 5  # per cent: what medians are told to
_CM2 = 1e4


def counts(judged: Mapping[str, Any]) -> Counter[str]:
    """Counters of one clip; a part that wasn't found counts in every denominator that it belongs to."""
    out = Counter[str]()
    for part in judged["parts"]:
        out["parts"] += 1
        out["found"] += part["found"]
        out["handles"] += part["has handle"]
        out["drawers"] += part["is drawer"]
        out["rear seen"] += part["rear seen"] is True
        if part["carcass"] is not None and part["carcass side seen"]:
            out["carcasses"] += 1
            out["carcass covered"] += part["carcass"] >= CARCASS
            out[f"carcass bin {_bin(part['carcass'])}"] += 1
        if part["found"]:
            out += _of_part(part)
            out += _of_layer(part)
        else:
            out["full bin 0"] += 1
    if judged["static"] is not None:
        out["furniture"] = 1
        out["furniture few shapes"] = int(judged["static"]["shapes"] <= FURNITURE_SHAPES)
        out += _of_layer(judged["static"], "static ")
    return out


def _of_part(part: Mapping[str, Any]) -> Counter[str]:
    out = Counter[str]()
    out["full"] += part["full"] >= FULL
    out["full, rear seen"] += part["rear seen"] is True and part["full"] >= FULL_REAR
    out[f"full bin {_bin(part['full'])}"] += 1
    out[f"seen layer bin {_bin(part['full, seen layer'])}"] += 1
    out["few shapes"] += part["shapes"] <= PART_SHAPES
    out["outside"] += part["outside p95, mm"] is not None and part["outside p95, mm"] <= OUTSIDE_MM
    if part["volume ratio"] is not None:
        for name, (low, high), asked in (
            ("ratio", RATIO, True),
            ("two-faced ratio", RATIO_TWO_FACES, part["both faces seen"] is True),
        ):
            out[f"{name}s"] += asked
            out[name] += asked and low <= part["volume ratio"] <= high
    if part["sight"] is not None:
        out["sights"] += 1
        out["not seen through"] += part["sight"]["through"] <= THROUGH
        out["not seen through inside"] += part["sight"]["inside"] <= THROUGH
    if part["handle"] is not None:
        out += _of_handle(part["handle"], part["handle assumed"])
    if part["balls"] is not None:
        out["balls"] += BALLS
        out["balls kept"] += part["balls"]
        out["drawers that hold all"] += part["balls"] == BALLS
    return out


def _of_handle(handle: Mapping[str, Any], assumed: bool) -> Counter[str]:
    out = Counter[str]()
    right = all(abs(handle[k] - handle["true"]) <= HANDLE_OFF for k in ("visual", "collider"))
    out["handle right"] += right
    out["handle wrong but assumed"] += assumed and not right
    out["handle right or assumed"] += assumed or right
    if handle["gap"] is not None:
        out["gaps"] += 1
        out["gap free"] += handle["gap"] >= GAP
    return out


def _of_layer(layer: Mapping[str, Any], of: str = "") -> Counter[str]:
    out = Counter[str]()
    for basis, area in layer["inferred"].items():
        out[f"{of}{basis}, cm2"] += round(_CM2 * area["area"])
        out[f"{of}{basis} off, cm2"] += round(_CM2 * area["area"] * area["off"])
        out[f"{of}{basis} bodies"] += 1
        out[f"{of}{basis} bodies right"] += area["off"] <= INFERRED_OFF
    for name in ("pieces", "shapes"):
        out[name] += layer[name]
        out[f"open {name}"] += len(layer[f"open {name}"])
    return out


def _bin(share: float) -> int:
    """Lower edge, in per cent, of the bin that a share is in; all of it has one of its own."""
    return int(BIN * ((100 * share + 1e-9) // BIN))
