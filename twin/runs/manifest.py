"""RUN/manifest.json: what a run has done, by which versions."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any

from twin.files.text import read_json, write_json

MANIFEST = "manifest.json"
PACKAGES = ("funtwin", "numpy", "scipy", "open3d", "opencv-contrib-python", "scikit-learn", "mujoco")


def update_manifest(folder: Path, **sections: Any) -> None:
    """Replace top-level sections of RUN/manifest.json, atomically, and keep the others."""
    path = folder / MANIFEST
    manifest = read_json(path)
    manifest = {"format": "funtwin-run/1"} | manifest | sections
    write_json(path, manifest)


def versions() -> dict[str, str]:
    """Versions of Python and of the installed packages that shape the results."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    found = {"python": python_version()}
    for package in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def opened_with(folder: Path) -> dict[str, Any]:
    """What the run's recording was opened with beside its path, as keywords of `recon.open_recording`."""
    known = read_json(folder / MANIFEST).get("opened_with")
    told = dict(known) if isinstance(known, dict) else {}
    if isinstance(told.get("calibration"), str):
        told["calibration"] = folder / told["calibration"]  # as it is noted: seen from the run folder
    return told
