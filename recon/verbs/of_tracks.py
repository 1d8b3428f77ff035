"""The tracks of a run for those that show them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recon.pipeline import read_stage
from recon.tracking.tracks import SparseTracks
from twin.errors import FuntwinError
from twin.geometry import Array


def tracks_seen(run: Path) -> dict[int, Array]:
    """Points (n, 3) m of the tracks that a frame sees, in its camera, by frame; empty without tracks."""
    try:
        tracks: SparseTracks = read_stage(run, "tracks")
    except FuntwinError:
        return {}
    points = tracks.camera.backproject(tracks.xy.astype(np.float64), tracks.depth.astype(np.float64))
    return {f: points[tracks.starts[f] : tracks.starts[f + 1]] for f in range(tracks.frames)}
