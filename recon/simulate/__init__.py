"""Simulated egocentric RGB-D recordings with exact truth, from any MJCF scene with hinge or slide joints."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recon.simulate.config import SimulateConfig
    from recon.simulate.kitchen import kitchen_scene
    from recon.simulate.random.scene import simulate_random
    from recon.simulate.simulator import simulate
    from recon.simulate.walk.scene import simulate_walk

__all__ = ["SimulateConfig", "kitchen_scene", "simulate", "simulate_random", "simulate_walk"]

_LAZY = {
    "SimulateConfig": "recon.simulate.config",
    "kitchen_scene": "recon.simulate.kitchen",
    "simulate": "recon.simulate.simulator",
    "simulate_random": "recon.simulate.random.scene",
    "simulate_walk": "recon.simulate.walk.scene",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'recon.simulate' has no attribute {name!r}")
