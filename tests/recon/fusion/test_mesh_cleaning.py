"""Which pieces of a mesh belong to one body."""

from __future__ import annotations

import numpy as np

from recon.fusion.mesh_cleaning import keep_large_pieces
from tests.makers.recon.tiny import box, merged


def _kept(gap: float, share: float, max_gap: float = np.inf) -> int:
    big, small = box((0, 0, 0), (1, 1, 1)), box((0.5 + gap + 0.15, 0, 0), (0.3, 0.3, 0.3))
    both = merged(big, small)
    _, faces = keep_large_pieces(both.vertices, both.faces, share, max_gap)
    return len(faces)


def test_pieces_stay_by_area_and_by_distance() -> None:
    # areas are 6 and 0.54 m^2; corners, not faces, measure the gap, so that it is larger than the 0.1 m
    # between planes
    assert _kept(0.1, share=0.05) == 24
    assert _kept(0.1, share=0.2) == 12
    assert _kept(5.0, share=0.05) == 24
    assert _kept(5.0, share=0.05, max_gap=1.0) == 12
    assert _kept(0.1, share=0.05, max_gap=1.0) == 24


def test_a_chain_of_pieces_holds_together() -> None:
    chain = merged(*(box((0.9 * k, 0, 0), (0.5, 0.5, 0.5)) for k in range(4)))
    assert len(keep_large_pieces(chain.vertices, chain.faces, 0.5, 0.45)[1]) == 48
    assert len(keep_large_pieces(chain.vertices, chain.faces, 0.5, 0.35)[1]) == 12
