"""Legal twins whose meshes and collision shapes are unusual."""

from __future__ import annotations

import numpy as np

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import (
    DOOR,
    HINGE,
    Draft,
    Shape,
    board,
    box,
    empty_room,
    frame_boards,
    physics,
    ply,
    prismatic,
    revolute,
    rotation,
    sheet,
    solid,
)

CASES = Cases("legal")
_FLAT = ((-0.3, -0.013, 0.005), (0.3, -0.013, 0.795))


@CASES.add("a flat visual mesh with a stated box and mass")
def _flat(d: Draft) -> None:
    d.shape("meshes/door.ply", sheet(*_FLAT))


@CASES.add("a flat mesh of which nothing is stated")
def _sheet(d: Draft) -> None:
    d.shape("meshes/door.ply", sheet(*_FLAT).finer(3))
    d.door.update(collision=[], inertial=None, physics=None, contact=None)


@CASES.add("a slanted flat mesh")
def _slanted_sheet(d: Draft) -> None:
    shape = sheet((0, 0, 0), (0.4, 0, 0.5)).finer(2).moved((1.5, 0, 0), rotation((1, 2, 3), 0.5))
    d.part(3, "poster", revolute((0, 0, 1.0), (1.5, 0, 0)), shape)["collision"] = []


@CASES.add("vertices that no face uses, 40 m away")
def _stray(d: Draft) -> None:
    shape = board(*DOOR)
    d.shape(
        "meshes/door.ply", Shape(np.concatenate([shape.vertices, [[40.0, 40, 40], [0, 0, -9]]]), shape.faces)
    )


@CASES.add("faces that stand twice, and faces without area")
def _twice(d: Draft) -> None:
    shape = board(*DOOR)
    faces = np.concatenate([shape.faces, shape.faces, [[0, 0, 1], [2, 2, 2]]])
    d.shape("meshes/door.ply", Shape(shape.vertices, faces))


@CASES.add("a door of 50 000 faces")
def _fine(d: Draft) -> None:
    d.shape("meshes/door.ply", board(*DOOR).finer(6))
    d.door["collision"] = []


@CASES.add("bodies that overlap, mass stated", warned=("overlap",))
def _overlap(d: Draft) -> None:
    low, high = (-0.1, -0.04, 0.2), (0.1, -0.015, 0.6)  # a panel 8 mm deep in the door
    d.shape("meshes/door.ply", board(*DOOR) + board(low, high))
    d.door["collision"].append(box(low, high))


@CASES.add("a closed body inside another")
def _inside(d: Draft) -> None:
    d.shape("meshes/door.ply", board(*DOOR) + board((-0.1, -0.016, 0.2), (0.1, -0.010, 0.6)))


@CASES.add("a mesh that is inside out")
def _inward(d: Draft) -> None:
    shape = board(*DOOR)
    d.shape("meshes/door.ply", Shape(shape.vertices, shape.faces[:, ::-1]))
    d.door.update(inertial=None, collision=[])


@CASES.add("collision stated for the door and not for the frame")
def _one(d: Draft) -> None:
    d.document["static"]["collision"] = []


@CASES.add("collision stated for the frame and not for the door")
def _other(d: Draft) -> None:
    d.door["collision"] = []


@CASES.add("collision meshes with names of their own")
def _named(d: Draft) -> None:
    low, high = DOOR
    middle = (0.0, high[1], high[2])
    d.door["collision"] = [
        d.shape("hulls/left half.ply", board(low, middle)),
        d.shape("hulls/right half.ply", board((0.0, low[1], low[2]), high)),
    ]
    d.document["static"]["collision"] = []


@CASES.add("a part's mesh that is its collision mesh too")
def _same(d: Draft) -> None:
    d.door["collision"] = ["meshes/door.ply"]


@CASES.add("boxes and convex meshes in one list, a box turned")
def _mixed(d: Draft) -> None:
    low, high = (-0.1, -0.05, 0.3), (0.1, -0.03, 0.5)
    knob = box(low, high, rotation((0, 1, 0), 0.3))
    wedge = Shape(
        np.array([[0.1, -0.023, 0.1], [0.2, -0.023, 0.1], [0.15, -0.04, 0.1], [0.15, -0.03, 0.2]]),
        np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    )
    d.door["collision"] += [d.shape("meshes/wedge.ply", wedge), knob]


@CASES.add("a static scene without vertices", empty_room)
def _empty(d: Draft) -> None:
    d.shape("meshes/ground.ply", Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int64)))
    d.document["static"]["collision"] = []
    low, high = (0, 0, 0), (0.4, 0.02, 0.6)
    d.part(
        2,
        "door",
        revolute((0, 0, 1.0), low),
        board(low, high),
        inertial=solid(3.0, low, high),
        physics=physics(),
    )


@CASES.add("a static scene of points without faces", empty_room)
def _points(d: Draft) -> None:
    _empty(d)
    d.shape("meshes/ground.ply", Shape(frame_boards().vertices, np.zeros((0, 3), np.int64)))


@CASES.add("colours on the door and none on the frame")
def _colored(d: Draft) -> None:
    d.shape("meshes/door.ply", ply(board(*DOOR), colors=(200, 30, 30)))


@CASES.add("an open scan without a back")
def _scan(d: Draft) -> None:
    shape = board(*DOOR)
    normal = np.cross(
        *(shape.vertices[shape.faces[:, k]] - shape.vertices[shape.faces[:, 0]] for k in (1, 2))
    )
    d.shape("meshes/door.ply", Shape(shape.vertices, shape.faces[normal[:, 1] < 1e-12]).finer(2))
    d.door.update(inertial=None, physics=None, collision=[])


@CASES.add("a drawer of five boards of which nothing is stated")
def _drawer(d: Draft) -> None:
    x, y, z = 0.25, 0.33, 0.3
    boards = [
        ((-x, 0.0, 0.1), (x, 0.02, z)), ((-x, 0.02, 0.1), (-x + 0.012, y, z)), ((x - 0.012, 0.02, 0.1), (x, y, z)),
        ((-x + 0.012, 0.02, 0.1), (x - 0.012, y, 0.112)), ((-x + 0.012, y - 0.012, 0.112), (x - 0.012, y, z)),
    ]  # fmt: skip
    shape = board(*boards[0])
    for low, high in boards[1:]:
        shape += board(low, high)
    d.document["parts"] = []
    d.part(2, "drawer", prismatic((0.0, -1.0, 0.0), 0.25), shape)["collision"] = []


@CASES.add("ten parts in a row", empty_room)
def _ten(d: Draft) -> None:
    for k in range(10):
        low, high = (0.6 * k, 0, 0), (0.6 * k + 0.5, 0.02, 0.5)
        d.part(
            2 + 25 * k,
            f"door_{k}",
            revolute((0, 0, 1.0), low),
            board(low, high),
            inertial=solid(2.0, low, high),
            physics=physics(),
        )


@CASES.add("a hinge that lies a metre off its part", faults=("its axis does not touch the part it turns",))
def _crane(d: Draft) -> None:
    d.door["joint"]["pivot"] = [HINGE[0] - 1.0, HINGE[1] - 0.3, 0.0]
    d.door["joint"]["upper"] = 0.8
