"""Reconstruction: one egocentric RGB-D recording in, a `twin.Twin` out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recon.config import ReconConfig
    from recon.inspection.finding import Inspection
    from recon.inspection.inspect import inspect
    from recon.joints.fit_tracks import MotionFit, fit_motion, fit_motion_poses
    from recon.pipeline import reconstruct
    from recon.readers import open_recording
    from recon.recording import Frame, Intrinsics, Recording
    from recon.recording.said import Said

__all__ = [
    "Frame",
    "Inspection",
    "Intrinsics",
    "MotionFit",
    "ReconConfig",
    "Recording",
    "Said",
    "fit_motion",
    "fit_motion_poses",
    "inspect",
    "open_recording",
    "reconstruct",
]

_LAZY = {
    "Frame": "recon.recording",
    "Inspection": "recon.inspection.finding",
    "Intrinsics": "recon.recording",
    "MotionFit": "recon.joints.fit_tracks",
    "ReconConfig": "recon.config",
    "Recording": "recon.recording",
    "Said": "recon.recording.said",
    "fit_motion": "recon.joints.fit_tracks",
    "fit_motion_poses": "recon.joints.fit_tracks",
    "inspect": "recon.inspection.inspect",
    "open_recording": "recon.readers",
    "reconstruct": "recon.pipeline",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'recon' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
