"""Units of what a user gives, of weights and resistances; imports nothing heavy, for a quick command line."""

from __future__ import annotations

import math
import re

UNITS = {
    "mass": "kg",
    "friction": "1 (sliding friction coefficient)",
    "damping": "N m s/rad for a hinge, N s/m for a slide",
    "frictionloss": "N m for a hinge, N for a slide",
}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 1e-3}


def number_and_unit(text: str) -> tuple[float, str]:
    """Number and unit of a text such as "24 N", the unit without spaces or ""; NaN without a number."""
    found = re.fullmatch(r"\s*([-+0-9.eE]*[0-9.])\s*([A-Za-z% ]*)", text)
    try:
        return (float(found[1]), found[2].replace(" ", "")) if found else (math.nan, "")
    except ValueError:
        return math.nan, ""
