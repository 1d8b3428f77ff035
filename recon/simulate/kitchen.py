"""The Franka Kitchen: found inside the installed gymnasium-robotics, which is not imported."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from twin.errors import MissingDependencyError
from twin.packages import to_install

INSIDE = Path("envs", "assets", "kitchen_franka", "kitchen_assets", "kitchen_env_model.xml")


def kitchen_scene() -> Path:
    """Path of the Franka Kitchen's MJCF. Raises MissingDependencyError naming the extra if absent."""
    spec = find_spec("gymnasium_robotics")
    for place in (spec.submodule_search_locations or []) if spec is not None else []:
        if (Path(place) / INSIDE).is_file():
            return Path(place) / INSIDE
    raise MissingDependencyError(
        "the Franka Kitchen is not installed", to_install("gymnasium-robotics", "simulate")
    )
