"""Tracks made for a test, as the tracker stores them."""

from __future__ import annotations

import numpy as np

from recon.recording import Intrinsics
from recon.tracking.tracks import SparseTracks, Tracks


def sparse(tracks: Tracks, camera: Intrinsics) -> SparseTracks:
    """Tracks as rows, tracked in pictures of the recording's own size."""
    frame, track = np.nonzero(tracks.visible)
    starts = np.searchsorted(frame, np.arange(len(tracks.visible) + 1)).astype(np.int64)
    xy = tracks.pixels[frame, track].astype(np.float32)
    depth = tracks.points_cam[frame, track, 2].astype(np.float32)
    return SparseTracks(starts, track.astype(np.int32), xy, depth, len(tracks), camera, 1.0)
