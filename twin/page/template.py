"""Templates of pages: what is put in is text, and nothing may be missing."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any


@cache
def template(path: Path) -> Any:
    """The Jinja template of a file."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(path.parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(path.name)
