"""RUN/manifest.json: what a run has done, by which versions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any

from twin.files.text import read_json, write_json

MANIFEST = "manifest.json"
# the user's edits of a run's twin, and the folder of the twin without them: twin.edits
EDITS, FOUND = "edits.json", "twin_found"
# What the folders of a window that is solved a second time end in.
AGAIN = "-again"
PACKAGES = ("funtwin", "numpy", "scipy", "open3d", "opencv-contrib-python", "scikit-learn", "mujoco")


def update_manifest(folder: Path, **sections: Any) -> None:
    """Replace top-level sections of RUN/manifest.json, atomically, and keep the others."""
    path = folder / MANIFEST
    manifest = read_json(path)
    manifest = {"format": "funtwin-run/1"} | manifest | sections
    write_json(path, manifest)


def warnings_of(stages: Sequence[Mapping[str, Any]]) -> list[tuple[str, tuple[int, int] | None, str]]:
    """The warnings of a run's stages, each once for a window: the stage, the first and last frame of the
    window, None for a stage of the whole recording, and the text. Of a window that was solved again they are
    those of the second time."""
    out: dict[tuple[str, str], str] = {}
    names = [stage["name"].partition("/") for stage in stages]
    items = {item for _, _, item in names}
    for stage, (name, _, item) in zip(stages, names, strict=True):
        if item and f"{item}{AGAIN}" in items:
            continue
        for text in stage["warnings"]:
            out.setdefault((item.removesuffix(AGAIN), text), name)
    return [(name, _frames(item), text) for (item, text), name in out.items()]


def seconds_of(stages: Sequence[Mapping[str, Any]]) -> float:
    """s in which at least one of a run's stages was computed: several windows are at a time. Of a run whose
    manifest doesn't tell when they began, their sum."""
    if not all(s.get("began") for s in stages):
        return float(sum(s["seconds"] for s in stages))
    spent, until = 0.0, 0.0
    for began, seconds in sorted((s["began"], s["seconds"]) for s in stages):
        spent += max(0.0, began + seconds - max(began, until))
        until = max(until, began + seconds)
    return spent


def _frames(item: str) -> tuple[int, int] | None:
    first, _, last = item.partition("-")
    return (int(first), int(last)) if item else None


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
