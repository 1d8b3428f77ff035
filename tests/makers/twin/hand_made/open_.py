"""Open twins: reading and refusing them are both right, saying nothing is not."""

from __future__ import annotations

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import Draft, board, empty_room, solid

CASES = Cases("open")


@CASES.add(
    "a contact half a metre off its part",
    refused=("door", "contact"),
    warned=("contact of door", "m off the part"),
)
def _contact(d: Draft) -> None:
    d.door["contact"]["point"] = [0.25, -0.52, 0.4]


@CASES.add("a byte order mark", refused=("twin.json", "BOM"), warned=())
def _bom(d: Draft) -> None:
    d.text = lambda text: text.encode("utf-8-sig")


@CASES.add("a key that stands twice", refused=("twin.json", "'upper'", "twice"))
def _twice(d: Draft) -> None:
    d.text = lambda text: text.replace('"upper": 1.5', '"upper": 1.5, "upper": 0.7').encode()


@CASES.add("a twin without parts", empty_room, refused=("part",), warned=("no moving part",))
def _none(d: Draft) -> None:
    pass


@CASES.add("a mesh path with backslashes", refused=("meshes\\door.ply",))
def _backslash(d: Draft) -> None:
    d.door["mesh"] = "meshes\\door.ply"


@CASES.add(
    "parts that collide when closed",
    refused=("door", "knob"),
    warned=("the collision shapes of 'door' and 'knob' overlap",),
)
def _collide(d: Draft) -> None:
    low, high = (-0.05, -0.03, 0.3), (0.05, 0.2, 0.5)
    joint = {**d.door["joint"], "type": "prismatic", "axis": [0, -1, 0], "pivot": None, "upper": 0.2}
    d.part(3, "knob", joint, board(low, high), inertial=solid(1.0, low, high))


@CASES.add(
    "a motion beyond the limits",
    refused=("motion", "0.018 to 0.882"),  # its 2 % and 98 %
    warned=("largest distance from the recorded poses",),
)
def _beyond(d: Draft) -> None:
    d.door["joint"]["upper"] = 0.3
    state = [0.9 * k / 9 for k in range(10)]
    d.door["motion"] = {
        "frames": list(range(10)), "times": [k / 15 for k in range(10)], "state": state, "intervals": [[0, 9]],
        "residual": 0.001, "inliers": 1.0,
    }  # fmt: skip
