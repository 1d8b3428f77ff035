"""Simulated surfaces of one colour each: to paint their textures takes most of the time of a small stage."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.simulate import textures
from recon.simulate.painters import SIZE
from twin.geometry import Array


@contextmanager
def plain_surfaces(size: int = SIZE) -> Iterator[None]:
    """Materials that are made meanwhile have no detail. size: texels per side; rendering needs SIZE."""

    def even(_: np.random.Generator, colour: Array) -> NDArray[np.float32]:
        return np.tile(colour.astype(np.float32), (size, size, 1))

    with pytest.MonkeyPatch.context() as patch:
        for kind, (_, tile, gloss) in textures.PAINTERS.items():
            patch.setitem(textures.PAINTERS, kind, (even, tile, gloss))
        yield
