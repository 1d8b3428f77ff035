"""Legal twins: names, joints, masses, and fields that are left out."""

from __future__ import annotations

import numpy as np

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import (
    CONTACT,
    DOOR,
    Draft,
    board,
    box,
    empty_room,
    frame_boards,
    physics,
    ply,
    prismatic,
    quantity,
    revolute,
    rotation,
    solid,
)

CASES = Cases("legal")
_UP = (0.0, 0.0, 1.0)


@CASES.add("everything stated")
def _plain(d: Draft) -> None:
    pass


@CASES.add("nothing stated that may be left out", warned=("mass",))
def _bare(d: Draft) -> None:
    d.document["static"]["collision"] = []
    d.door.update(collision=[], inertial=None, physics=None, contact=None)


@CASES.add("twin named scene and static scene named floor")
def _scene(d: Draft) -> None:
    d.document["name"], d.document["static"]["name"] = "scene", "floor"


@CASES.add("twin named assets with a part named meshes")
def _assets(d: Draft) -> None:
    d.document["name"], d.door["name"] = "assets", "meshes"
    d.document["static"]["name"] = "materials"


@CASES.add("names that other files and classes of an export have")
def _clashes(d: Draft) -> None:
    d.document["name"], d.document["static"]["name"] = "README", "scene"
    for k, name in enumerate(
        ("door_visual", "door_collision_0", "door_joint", "Looks", "base_link", "visual", "collision")
    ):
        low, high = (2.0 + k, 0, 0), (2.4 + k, 0.02, 0.4)
        d.part(
            10 + k,
            name,
            revolute(_UP, low),
            board(low, high),
            inertial=solid(1.0, low, high),
            physics=physics(),
        )


@CASES.add("names of 200 characters")
def _long(d: Draft) -> None:
    d.document["name"], d.document["static"]["name"], d.door["name"] = "t" * 200, "s" * 200, "d" * 200


@CASES.add("words that mean something in XML and Python as names")
def _keywords(d: Draft) -> None:
    d.document["name"], d.document["static"]["name"], d.door["name"] = "None", "xml", "class"
    low, high = (2.0, 0, 0), (2.4, 0.02, 0.4)
    d.part(
        3, "mujoco", revolute(_UP, low), board(low, high), inertial=solid(1.0, low, high), physics=physics()
    )


@CASES.add("a range that begins below zero", empty_room)
def _negative(d: Draft) -> None:
    low, high = (0, -0.01, 0), (0.5, 0.01, 0.9)
    joint = revolute(_UP, (0, 0, 0), 1.2, -1.2)
    d.part(2, "saloon_door", joint, board(low, high), inertial=solid(4.0, low, high), physics=physics())


@CASES.add("a range of one millimetre")
def _short(d: Draft) -> None:
    d.door["joint"] = prismatic((0.0, -1.0, 0.0), 0.001)


@CASES.add("a range of 350 degrees", empty_room)
def _wide(d: Draft) -> None:
    low, high = (0, 0, 0), (0.4, 0.02, 0.4)
    d.part(
        2,
        "wheel",
        revolute(_UP, (0.2, 0.01, 0), 6.1),
        board(low, high),
        inertial=solid(2.0, low, high),
        physics=physics(),
    )


@CASES.add("a lid 1 mm thick of 1 g", empty_room)
def _light(d: Draft) -> None:
    low, high = (0, 0, 0), (0.03, 0.02, 0.001)
    joint = revolute((1.0, 0, 0), (0, 0, 0), 1.0)
    d.part(2, "lid", joint, board(low, high), inertial=solid(0.001, low, high))


@CASES.add("a gate 10 m long of 300 kg", empty_room)
def _heavy(d: Draft) -> None:
    low, high = (0, 0, 0), (10, 0.08, 2)
    d.part(2, "gate", revolute(_UP, (0, 0.04, 0)), board(low, high), inertial=solid(300.0, low, high))


@CASES.add("a lid of 1 g beside a gate of 300 kg", empty_room)
def _both(d: Draft) -> None:
    _light(d)
    low, high = (2, 0, 0), (6, 0.08, 2)
    d.part(3, "gate", revolute(_UP, (2, 0.04, 0)), board(low, high), inertial=solid(300.0, low, high))


@CASES.add("parts nested three deep", empty_room)
def _nested(d: Draft) -> None:
    for k, parent in enumerate((None, 2, 3)):
        low, high = (0, -0.03 * k, 0), (0.6 - 0.15 * k, 0.02 - 0.03 * k, 0.6 - 0.15 * k)
        joint = revolute((0.0, 0.0, -1.0), low, 1.0)
        d.part(
            2 + k,
            f"leaf_{k}",
            joint,
            board(low, high),
            parent,
            inertial=solid(3.0 - k, low, high),
            physics=physics(),
        )


@CASES.add("children listed before their parents", empty_room)
def _unsorted(d: Draft) -> None:
    _nested(d)
    d.parts.reverse()


@CASES.add("two doors on one hinge line", empty_room)
def _hinge(d: Draft) -> None:
    for k, z in enumerate((0.0, 0.45)):
        low, high = (0, 0, z), (0.5, 0.02, z + 0.44)
        d.part(
            2 + k,
            f"leaf_{k}",
            revolute(_UP, (0, 0, 0)),
            board(low, high),
            inertial=solid(2.0, low, high),
            physics=physics(),
        )


@CASES.add("a drawer hidden behind the door")
def _hidden(d: Draft) -> None:
    low, high = (-0.2, 0.05, 0.3), (0.2, 0.35, 0.4)
    d.part(
        3,
        "drawer",
        prismatic((0.0, -1.0, 0.0), 0.03),
        board(low, high),
        inertial=solid(2.0, low, high),
        physics=physics(),
    )


@CASES.add("slanted axes of a turned cupboard")
def _slanted(d: Draft) -> None:
    turn = rotation((0.3, -0.5, 0.8), 0.9)
    low, high = (0, 0, 0), (0.3, 0.02, 0.2)
    shape = board(low, high).moved(rotation=turn).moved((2, 0, 0.5))
    center = turn @ np.array([0.15, 0.01, 0.1]) + [2, 0, 0.5]
    tensor = turn @ np.diag(solid(1.0, low, high)["inertia"][:3]) @ turn.T
    inertial = {**solid(1.0, low, high), "com": center.tolist()}
    inertial["inertia"] = [tensor[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    stated = {"inertial": inertial, "physics": physics(frictionloss=1.0)}
    part = d.part(3, "hatch", revolute(turn @ [0, 0, 1], (2, 0, 0.5), 1.0), shape, **stated)
    b = box(low, high, turn)
    part["collision"] = [{**b, "center": center.tolist()}]


@CASES.add(
    "a drawer that slides upwards and needs 30 N",
    empty_room,
    cause=("opened by 10 N", "against friction of 30 N"),
    doubted=("10 N don't bring it to its upper limit",),
)
def _upwards(d: Draft) -> None:
    low, high = (0, 0, 0.5), (0.4, 0.02, 0.9)
    stated = {"inertial": solid(2.0, low, high), "physics": physics(frictionloss=30.0)}
    d.part(2, "shutter", prismatic(_UP, 0.4), board(low, high), **stated)


@CASES.add("a lid that its own weight holds shut")
def _lid(d: Draft) -> None:
    low, high = (-0.3, 0.0, 0.803), (0.3, 0.4, 0.823)
    d.part(
        3,
        "lid",
        revolute((-1.0, 0.0, 0.0), (0, 0.4, 0.823), 1.2),
        board(low, high),
        inertial=solid(2.0, low, high),
    )


@CASES.add("a flap that its own weight opens", empty_room, warned=("weight",), doubted=("nobody touches it",))
def _falls(d: Draft) -> None:
    low, high = (0, 0, 0), (0.5, 0.4, 0.02)
    stated = {"inertial": solid(3.0, low, high), "physics": physics(frictionloss=0.1)}
    d.part(2, "flap", revolute((-1.0, 0.0, 0.0), (0, 0, 0.0), 1.2), board(low, high), **stated)


@CASES.add("a scene one kilometre off its origin")
def _far(d: Draft) -> None:
    by = np.array([800.0, -600.0, 30.0])
    d.files["twin/meshes/frame.ply"] = ply(frame_boards().moved(by))
    d.files["twin/meshes/door.ply"] = ply(board(*DOOR).moved(by))
    for owner in (d.document["static"], d.door):
        for shape in owner["collision"]:
            shape["center"] = (np.array(shape["center"]) + by).tolist()
    for field, key in (("joint", "pivot"), ("inertial", "com"), ("contact", "point")):
        d.door[field][key] = (np.array(d.door[field][key]) + by).tolist()


@CASES.add("mass stated and friction not")
def _mass(d: Draft) -> None:
    d.door["physics"] = None


@CASES.add("friction stated and mass not")
def _friction(d: Draft) -> None:
    d.door["inertial"] = None


@CASES.add("no friction and no damping at all")
def _ideal(d: Draft) -> None:
    for key in ("damping", "frictionloss"):
        d.door["physics"][key] = {**quantity(0.0), "interval": [0.0, 0.0]}


@CASES.add("intervals of mass, centre and tensor")
def _intervals(d: Draft) -> None:
    com = d.door["inertial"]["com"]
    d.door["inertial"].update(
        mass_interval=[0.0, 40.0],
        inertia_source="user: drawn in CAD",
        inertia_interval=[0.0, 10.0],
        com_interval=[[v - 0.1 for v in com], [v + 0.1 for v in com]],
    )


@CASES.add("what older twins lack")
def _old(d: Draft) -> None:
    for key in ("sigma", "covariance"):
        del d.door["joint"][key]
    d.door["inertial"]["source"] = "surface area x thickness x density"
    d.door["physics"]["damping"]["source"] = "chosen by us"
    for key in ("inertial", "physics", "contact"):
        d.door.setdefault(key, None)
    del d.document["cameras"], d.document["recording"], d.document["provenance"]


@CASES.add("uncertainty of the joint")
def _uncertain(d: Draft) -> None:
    d.door["joint"]["sigma"] = {"axis_deg": 0.4, "pivot_m": 0.002, "state": 0.01}
    d.door["joint"]["covariance"] = (np.eye(4) * 1e-5).tolist()


@CASES.add("a filmed motion with cameras and labels")
def _filmed(d: Draft) -> None:
    lines = [f"{k / 15:.6f} 0 -2 {1 + k / 100} -0.70710678 0 0 0.70710678" for k in range(20)]
    d.files["twin/cameras.txt"] = "\n".join(["# by another program", *lines, ""]).encode()
    d.document["cameras"] = {"file": "cameras.txt", "frames": list(range(20))}
    d.document["recording"] = {"source": "film", "frames": 20, "fingerprint": "0" * 16}
    state = [1.5 * k / 19 for k in range(20)]
    d.door["motion"] = {
        "frames": list(range(20)), "times": [k / 15 for k in range(20)], "state": state, "intervals": [[0, 19]],
        "residual": 0.001, "inliers": 0.9,
    }  # fmt: skip
    d.door["contact"] = dict(CONTACT)
