"""A room with several pieces of furniture: each is completed as if it stood alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.makers.twin import scans
from tests.makers.twin.layers import layer, pieces
from twin import geometry as geo
from twin.completion.infer import infer
from twin.placed import placed
from twin.scene import Box, Twin

# A room around all: floor, and walls that no furniture stands at.
ROOM = scans.surface(
    [
        ((-3.0, -3.0, -0.02), (6.0, 4.0, 0.0), "+z"),
        ((-3.0, 4.0, 0.0), (6.0, 4.1, 2.4), "-y"),
        ((-3.1, -3.0, 0.0), (-3.0, 4.0, 2.4), "+x"),
        ((6.0, -3.0, 0.0), (6.1, 4.0, 2.4), "-x"),
    ]
)
# Turned against the other, and beside it with a gap that no piece of furniture has.
T_TURNED = geo.make_pose(geo.exp_so3([0.0, 0.0, 0.9]), [2.5, 1.0, 0.0])
T_BESIDE = geo.make_pose(None, [1.6, 0.0, 0.0])


def drawer() -> Twin:
    """A drawer in its cabinet."""
    return scans.twin_of(scans.drawer(), scans.CABINET)


def door(T: np.ndarray) -> Twin:
    """A door in its own cabinet, moved."""
    twin = scans.twin_of(scans.door(), scans.CABINET)
    return placed(replace(twin, parts=(replace(twin.parts[0], id=3, name="part_3"),)), T)


def in_room(*twins: Twin) -> Twin:
    """All in one room, seen by the first one's cameras."""
    static = replace(twins[0].static, mesh=scans.joined([*(t.static.mesh for t in twins), ROOM]))
    return replace(twins[0], static=static, parts=tuple(p for t in twins for p in t.parts))


def boxes(twin: Twin) -> dict[str, np.ndarray]:
    """Middle and size of each piece's box, rounded to 5 mm, by the piece's name."""
    out = {}
    for name, piece in pieces(twin).items():
        box = next(s for s in piece.shapes if isinstance(s, Box))
        out[name] = np.concatenate([box.T_world_box[:3, 3], np.sort(box.size)])
    return out


@pytest.mark.parametrize("T", [T_TURNED, T_BESIDE], ids=["turned", "beside"])
def test_a_cabinet_in_a_room_gets_the_boards_that_it_gets_alone(T: np.ndarray) -> None:
    alone = [boxes(infer(in_room(t))) for t in (drawer(), door(T))]
    wanted = {n: b for found in alone for n, b in found.items() if "_cabinet_" in n}
    found = boxes(infer(in_room(drawer(), door(T))))
    assert len(wanted) == 10
    for name, box in wanted.items():
        assert np.allclose(found[name], box, atol=0.003), name


def test_neighbours_of_two_pieces_of_furniture_have_names_of_their_own() -> None:
    """Each has a front beside it that nobody opened; both would have one name."""
    found = infer(in_room(drawer(), door(T_TURNED)))
    neighbours = [p for p in layer(found).pieces if p.role == "neighbour"]
    assert len(neighbours) == 2
    first, other = (p.mesh.vertices.mean(axis=0) for p in neighbours)
    assert np.linalg.norm(first - other) > 2.0


def test_furniture_of_another_piece_is_no_room() -> None:
    room = layer(infer(in_room(drawer(), door(T_TURNED)))).room
    assert room is not None
    assert len(room.faces) == len(ROOM.faces)
