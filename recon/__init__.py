"""Reconstruction: one egocentric RGB-D recording in, a `twin.Twin` out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recon.config import ReconConfig
    from recon.pipeline import reconstruct
    from recon.recording import Intrinsics, Recording, open_recording

__all__ = ["Intrinsics", "ReconConfig", "Recording", "open_recording", "reconstruct"]

_LAZY = {
    "Intrinsics": "recon.recording",
    "ReconConfig": "recon.config",
    "Recording": "recon.recording",
    "open_recording": "recon.recording",
    "reconstruct": "recon.pipeline",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'recon' has no attribute {name!r}")
