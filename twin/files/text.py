"""Text and JSON files that change at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from twin.files.atomic import write_file


def write_json(path: Path, data: Any) -> None:
    """Write JSON so that readers see the old or the new text, never a part."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Replace a text file at once."""
    write_file(path, text.encode())


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file; empty when the file is missing or no JSON object."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
