"""The committed page of benchmarks/replay.py."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def page(rows: Sequence[dict[str, Any]], trials: int) -> str:
    return ""
