"""Random people, cameras and picture faults, as settings of a simulated recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from recon.simulate.config import Faults, Staging
from recon.simulate.random.model import Placed
from recon.simulate.random.strata import Stratum, WalkStratum

Rng = np.random.Generator
_ARM = 0.88  # metres to the grip with the upper body bent forward; less than what a draw is refused for
_NEAR_SHARE = 0.6  # of the picture that the part's front covers in a near view, by its size alone


def hand_settings(rng: Rng) -> dict[str, Any]:
    """Which hand, in what, from where."""
    side = str(rng.choice(["right", "left"], p=[0.6, 0.4]))
    return {
        "hand_side": side,
        "hand_cover": str(rng.choice(["sleeve", "bare", "glove"], p=[0.4, 0.35, 0.25])),
        "skin_tone": int(rng.integers(6)),
        "hand_from_deg": None if rng.random() < 0.6 else float(rng.uniform(-180.0, 180.0)),
        "wrist_turn": float(rng.uniform(0.2, 1.0)),
    }


def camera_settings(rng: Rng, wanted: Stratum, pieces: Sequence[Placed]) -> dict[str, Any]:
    """Where the person stands and how the head moves."""
    hfov = float(rng.uniform(60.0, 88.0))
    pitch = float(rng.uniform(-30.0, 15.0))
    distance = float(rng.uniform(0.55, 1.0))
    made = pieces[0].made
    grip = float(made.grip.point[2])
    if wanted.view == "steep":
        pitch = float(rng.uniform(20.0, 30.0)) if grip > 1.15 else float(rng.uniform(-60.0, -35.0))
        distance = float(rng.uniform(0.45, 0.75)) if pitch < 0 else float(rng.uniform(0.6, 0.9))
    if wanted.view == "near":
        size = np.sort(np.ptp(np.concatenate([b.corners for b in made.panels]), axis=0))[1:]
        across = 2.0 * np.tan(np.radians(hfov) / 2.0)
        seen = across**2 * wanted.size[1] / wanted.size[0]
        distance = max(0.4, float(np.sqrt(size[0] * size[1] / (_NEAR_SHARE * seen))))
        pitch = float(rng.uniform(-20.0, 10.0))
    if wanted.view != "near":
        distance = min(distance, _reachable(-distance * float(np.tan(np.radians(pitch)))))
    rise = -distance * float(np.tan(np.radians(pitch)))
    moving = {"sidestep": float(rng.choice([-1.0, 1.0]) * rng.uniform(0.32, 0.5))}
    fast = {
        "sway": float(rng.uniform(4.0, 7.0)),
        "sidestep": float(rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.8)),
    }
    settings: dict[str, Any] = {
        "hfov_deg": hfov,
        "azimuth_deg": float(rng.uniform(-1.0, 1.0)) * (20.0 if wanted.view == "near" else 45.0),
        "distance": distance,
        "height_above_grip": float(np.clip(rise, 0.3 - grip, 2.2 - grip)),
        "sway": float(rng.uniform(0.4, 2.0)),
    }
    return (
        settings | (moving if wanted.view == "moving" else {}) | (fast if wanted.negative == "camera" else {})
    )


def _reachable(rise: float) -> float:
    """How far away a person with eyes `rise` m above the grip stands: an arm's length from the shoulder."""
    return float(np.sqrt(max(_ARM**2 - (rise - 0.5) ** 2, 0.45**2)))


def picture_settings(rng: Rng, wanted: Stratum | WalkStratum, config: Staging) -> Staging:
    """Clean pictures, or three to five faults at once."""
    if not wanted.hard_picture:
        return replace(config, picture=Faults(jpeg_quality=int(rng.integers(85, 96))))
    faults: list[dict[str, Any]] = [
        {"samples": 1},
        {"shutter": float(rng.uniform(0.5, 0.9))},
        {"jpeg_quality": int(rng.integers(40, 61))},
        {"light": float(rng.uniform(0.25, 0.35)), "flicker": float(rng.uniform(0.0, 0.15))},
        {"exposure_jumps": float(rng.uniform(0.2, 0.4))},
        {"rolling_shutter_s": float(rng.uniform(0.015, 0.03))},
        {"focal_error": float(rng.choice([-0.01, 0.01])), "centre_error_px": float(rng.uniform(-4.0, 4.0))},
        {"colour_delay_s": float(rng.uniform(0.015, 0.03))},
    ]
    chosen = rng.choice(len(faults), size=int(rng.integers(3, 6)), replace=False)
    picked = {k: v for i in chosen for k, v in faults[i].items()}
    samples = int(picked.pop("samples", 2))
    return replace(config, samples=samples, picture=Faults(**{"jpeg_quality": 90} | picked))
