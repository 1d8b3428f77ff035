"""Reconstruction: one egocentric RGB-D recording in, a `twin.Twin` out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recon.config import ReconConfig
    from recon.inspection.finding import Inspection
    from recon.inspection.inspect import inspect
    from recon.interaction.joints.fit_tracks import MotionFit, fit_motion, fit_motion_poses
    from recon.interaction.labels.label_frames import label_frames
    from recon.pipeline import read_stage, reconstruct
    from recon.readers import open_recording
    from recon.recording import Frame, Intrinsics, Recording
    from recon.recording.said import Said
    from recon.tracking.follow import track_points
    from recon.tracking.tracks import SparseTracks, Tracks

__all__ = [
    "Frame",
    "Inspection",
    "Intrinsics",
    "MotionFit",
    "ReconConfig",
    "Recording",
    "Said",
    "SparseTracks",
    "Tracks",
    "fit_motion",
    "fit_motion_poses",
    "inspect",
    "label_frames",
    "open_recording",
    "read_stage",
    "reconstruct",
    "track_points",
]

_LAZY = {
    "Frame": "recon.recording",
    "Inspection": "recon.inspection.finding",
    "Intrinsics": "recon.recording",
    "MotionFit": "recon.interaction.joints.fit_tracks",
    "ReconConfig": "recon.config",
    "Recording": "recon.recording",
    "Said": "recon.recording.said",
    "SparseTracks": "recon.tracking.tracks",
    "Tracks": "recon.tracking.tracks",
    "fit_motion": "recon.interaction.joints.fit_tracks",
    "fit_motion_poses": "recon.interaction.joints.fit_tracks",
    "inspect": "recon.inspection.inspect",
    "label_frames": "recon.interaction.labels.label_frames",
    "open_recording": "recon.readers",
    "read_stage": "recon.pipeline",
    "reconstruct": "recon.pipeline",
    "track_points": "recon.tracking.follow",
}


if not TYPE_CHECKING:  # a type checker that saw it would take every misspelled name for one that exists

    def __getattr__(name: str) -> Any:
        if name in _LAZY:
            return getattr(import_module(_LAZY[name]), name)
        raise AttributeError(f"module 'recon' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
