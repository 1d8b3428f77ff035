"""Runs of `twin reconstruct`: what one left, and what it computed."""

from __future__ import annotations

from pathlib import Path

from twin.cli import main as cli
from twin.files.text import read_json

STAGES = [
    "inspect", "tracks", "cameras", "gravity", "noise", "windows", "loops", "path", "motion", "refine", "labels", "polish", "merge",
    "fusion", "up", "contact", "texture", "verdict", "handle", "completion",
]  # fmt: skip


def reconstruct(recording: Path, folder: Path, *more: str) -> int:
    """Exit code of the command line."""
    return cli.run(["reconstruct", str(recording), "-o", str(folder), *more])


def twin_bytes(folder: Path) -> dict[str, bytes]:
    """Everything that makes up the twin."""
    paths = [p for p in sorted((folder / "twin").rglob("*")) if p.is_file()]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in paths}


def computed(folder: Path) -> dict[str, str]:
    """The stages that the last run computed, with the reason."""
    return {s["name"]: s["reason"] for s in read_json(folder / "manifest.json")["stages"] if not s["cached"]}
