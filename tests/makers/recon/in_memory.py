"""A recording of noise, made from arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from recon import Intrinsics, Recording
from tests.makers.recon.tiny import HEIGHT, WIDTH

T = 12
K = Intrinsics(WIDTH, HEIGHT, 80.0, 80.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)


def arrays(**changes: Any) -> dict[str, Any]:
    rng = np.random.default_rng(5)
    given = {
        "color": rng.integers(0, 256, (T, HEIGHT, WIDTH, 3), dtype=np.uint8),
        "depth": rng.uniform(0.5, 2.0, (T, HEIGHT, WIDTH)).astype(np.float32),
        "intrinsics": K.matrix,
        "fps": 15,
    }
    return {k: v for k, v in {**given, **changes}.items() if v is not None}


def made(**changes: Any) -> Recording:
    return Recording.from_arrays(**arrays(**changes))
