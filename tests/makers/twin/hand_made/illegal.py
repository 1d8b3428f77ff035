"""Illegal twins: what twin.json says can't be."""

from __future__ import annotations

from typing import Any

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import Draft, board, box, quantity, revolute

CASES = Cases("illegal")


def _value(name: str, path: str, value: Any, *words: str) -> None:
    """An illegal value in an otherwise good twin.json."""

    @CASES.add(name, refused=words)
    def change(d: Draft) -> None:
        *keys, last = (int(k) if k.isdecimal() else k for k in path.split("."))
        node: Any = d.document
        for key in keys:
            node = node[key]
        node[last] = value


_JOINT = "parts.0.joint"
_value("an axis of length 2", f"{_JOINT}.axis", [0, 0, 2], "parts[0].joint", "axis", "length 1", "2")
_value("an axis of length 0", f"{_JOINT}.axis", [0, 0, 0], "parts[0].joint", "axis", "length 1", "0")
_value("an axis that is not a number", f"{_JOINT}.axis", [0, 0, float("nan")], "axis")
_value("an axis of two numbers", f"{_JOINT}.axis", [0, 1], "parts[0].joint.axis", "shape", "(2,)")
_value("limits the wrong way round", f"{_JOINT}.lower", 2.0, "parts[0].joint", "limits", "2.0..1.5")
_value("an infinite limit", f"{_JOINT}.upper", float("inf"), "upper", "inf")
_value("a limit that is a text", f"{_JOINT}.upper", "90 deg", "parts[0].joint.upper", "'90 deg'")
_value("a limit that is true", f"{_JOINT}.upper", True, "parts[0].joint.upper", "True")
_value("an empty range", f"{_JOINT}.upper", 0.0, "'door'", "empty range")
_value("a hinge without a pivot", f"{_JOINT}.pivot", None, "parts[0].joint.pivot", "None")
_value("a ball joint", f"{_JOINT}.type", "ball", "parts[0].joint.type", "'ball'")
_value(
    "a covariance of the wrong shape",
    f"{_JOINT}.covariance",
    [[1, 0], [0, 1]],
    "parts[0].joint.covariance",
    "(2, 2)",
)
_value(
    "a covariance that is not symmetric",
    f"{_JOINT}.covariance",
    [[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    "parts[0].joint",
    "covariance",
    "symmetric",
)
_value("an axis of texts", f"{_JOINT}.axis", ["0", "0", "1"], "parts[0].joint.axis", "numbers only", "'1'")
_value(
    "an axis of true and false",
    f"{_JOINT}.axis",
    [False, False, True],
    "parts[0].joint.axis",
    "numbers only",
    "True",
)
_value(
    "frames beyond any film",
    "parts.0.motion.frames",
    [1e300],
    "parts[0].motion.frames",
    "whole numbers within",
)
_value(
    "a residual that is not a number",
    "parts.0.motion.residual",
    float("nan"),
    "parts[0].motion.residual",
    "nan",
)
_INERTIAL = "parts.0.inertial"
_value("a negative mass", f"{_INERTIAL}.mass", -4.0, "parts[0].inertial.mass", "positive", "-4.0")
_value("no mass at all", f"{_INERTIAL}.mass", 0, "parts[0].inertial.mass", "positive", "0")
_value(
    "a mass outside of its interval",
    f"{_INERTIAL}.mass_interval",
    [9, 10],
    "parts[0].inertial",
    "interval",
    "4.0",
)
_value(
    "a mass interval the wrong way round",
    f"{_INERTIAL}.mass_interval",
    [5, 3],
    "parts[0].inertial",
    "interval",
    "(5.0, 3.0)",
)
_value(
    "a tensor that is not positive definite",
    f"{_INERTIAL}.inertia",
    [1, 1, -1, 0, 0, 0],
    "parts[0].inertial",
    "positive definite",
)
_value(
    "a tensor that no body has",
    f"{_INERTIAL}.inertia",
    [1, 1, 5, 0, 0, 0],
    "parts[0].inertial",
    "triangle inequality",
)
_value("a tensor of nine numbers", f"{_INERTIAL}.inertia", [1.0] * 9, "parts[0].inertial.inertia", "(9,)")
_value("a mass with no source", f"{_INERTIAL}.source", " ", "parts[0].inertial", "source")
_value("a negative friction", "parts.0.physics.friction.value", -0.5, "parts[0].physics.friction", "-0.5")
_value(
    "a friction interval of one number",
    "parts.0.physics.friction.interval",
    [0.4],
    "parts[0].physics.friction.interval",
    "(1,)",
)
_value(
    "a negative damping",
    "parts.0.physics.damping",
    {**quantity(-1.0), "interval": [-2.0, 1.0]},
    "parts[0].physics",
    "damping",
    "-1",
)
_value(
    "a contact rotation that is no rotation",
    "parts.0.contact.rotation",
    [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
    "parts[0]",
    "contact rotation",
)
_value("a contact of negative width", "parts.0.contact.width", -0.01, "parts[0]", "contact width", "-0.01")
_value("an id of a hand", "parts.0.id", 255, "parts[0]", "id", "255")
_value("an id of 1.5", "parts.0.id", 1.5, "parts[0].id", "1.5")
_value("an id of true", "parts.0.id", True, "parts[0].id", "True")
_value("a parent that is not there", "parts.0.parent", 9, "9", "door")
_value("a part that is its own parent", "parts.0.parent", 2, "'door'", "ancestor")
_value("a name with an umlaut", "parts.0.name", "Tür", "parts[0]", "'Tür'", "'Tur'")
_value("a name with a slash", "parts.0.name", "../../door", "parts[0]", "'../../door'")
_value("a name that begins with a digit", "name", "2door", "'2door'")
_value("a twin named world", "name", "world", "'world'")
_value("an empty name", "static.name", "", "name ''")
_value("a name that is null", "parts.0.name", None, "parts[0].name", "None")
_value("a format of another version", "format", "funtwin/9", "format", "'funtwin/9'", "'funtwin/1'")
_value("parts that are an object", "parts", {"door": {}}, "parts", "must be a list")
_value("a part that is a text", "parts", ["door"], "parts[0]", "'door'")
_value("a static scene that is null", "static", None, "static", "None")
_value("motion of unequal lengths", "parts.0.motion.frames", [1, 2, 3], "parts[0].motion", "times", "(0,)")
_value(
    "an interval that ends before it begins",
    "parts.0.motion.intervals",
    [[9, 3]],
    "parts[0].motion",
    "interval",
    "(9, 3)",
)
_value(
    "a box without extent",
    "parts.0.collision.0.size",
    [0.6, 0, 0.8],
    "parts[0].collision[0]",
    "box size",
    "0.0",
)
_value(
    "a box that is turned into a mirror",
    "parts.0.collision.0.rotation",
    [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
    "parts[0].collision[0]",
    "axes",
)
_value(
    "a number of 1e300 as a box", "parts.0.collision.0.size", [1e300, 1, 1], "parts[0].collision[0]", "1e+300"
)
_value(
    "a mass of 1e300",
    _INERTIAL,
    {
        "mass": 1e300,
        "com": [0, 0, 0],
        "inertia": [1, 1, 1, 0, 0, 0],
        "source": "user: x",
        "mass_interval": [0, 1e301],
    },
    "parts[0].inertial.mass",
    "1e+300",
)
_value("a whole number too large for any float", "parts.0.joint.upper", 10**400, "parts[0].joint.upper")
_value("collision that is null", "parts.0.collision", None, "parts[0].collision", "None")
_value(
    "cameras of a file that is not there", "cameras", {"file": "cameras.txt", "frames": [0]}, "cameras.txt"
)


@CASES.add("two parts of one id", refused=("ids", "unique", "[2, 2]"))
def _ids(d: Draft) -> None:
    d.part(2, "lid", revolute((1, 0, 0), (0, 0, 1)), board((0, 0, 1), (1, 1, 1.1)))


@CASES.add("two parts of one name", refused=("names", "unique", "'door', 'door'"))
def _names(d: Draft) -> None:
    d.part(3, "door", revolute((1, 0, 0), (0, 0, 1)), board((0, 0, 1), (1, 1, 1.1)))


@CASES.add("names that differ by their case alone", refused=("names", "unique", "'Frame'", "'frame'"))
def _case(d: Draft) -> None:
    d.part(3, "Frame", revolute((1, 0, 0), (0, 0, 1)), board((0, 0, 1), (1, 1, 1.1)))


@CASES.add("parents in a circle", refused=("door", "ancestor"))
def _circle(d: Draft) -> None:
    d.part(3, "lid", revolute((1, 0, 0), (0, 0, 1)), board((0, 0, 1), (1, 1, 1.1)), 2)
    d.door["parent"] = 3


def _missing(path: str, words: str) -> None:
    @CASES.add(f"no {path}", refused=(words, "is missing"))
    def change(d: Draft) -> None:
        *keys, last = (int(k) if k.isdecimal() else k for k in path.split("."))
        node: Any = d.document
        for key in keys:
            node = node[key]
        del node[last]


_missing("format", "format")
_missing("parts", "parts")
_missing("static.collision", "static.collision")
_missing("parts.0.joint", "parts[0].joint")
_missing("parts.0.joint.lower", "parts[0].joint.lower")
_missing("parts.0.parent", "parts[0].parent")
_missing("parts.0.inertial.com", "parts[0].inertial.com")
_missing("parts.0.physics.density", "parts[0].physics.density")


def _text(name: str, text: bytes, *words: str) -> None:
    @CASES.add(name, refused=("twin.json", *words))
    def change(d: Draft) -> None:
        d.text = lambda _: text


_text("twin.json that is empty", b"", "JSON")
_text("twin.json that is cut short", b'{"format": "funtwin/1", "name": "a", "parts": [', "JSON")
_text("twin.json that is a list", b"[1, 2]", "must be an object", "[1, 2]")
_text("twin.json in another encoding", '{"name": "Tür"}'.encode("latin-1"), "utf-8")
_text("twin.json that is 100 000 lists deep", b"[" * 100_000 + b"]" * 100_000, "JSON")
_text("twin.json of YAML", b"format: funtwin/1\nname: a\n", "JSON")


@CASES.add("fewer camera poses than frames", refused=("cameras", "2 frames", "1 lines"))
def _cameras(d: Draft) -> None:
    d.files["twin/cameras.txt"] = b"0.0 0 0 0 0 0 0 1\n"
    d.document["cameras"] = {"file": "cameras.txt", "frames": [0, 1]}


@CASES.add("a camera without a rotation", refused=("cameras",))
def _rotation(d: Draft) -> None:
    d.files["twin/cameras.txt"] = b"0.0 0 0 0 0 0 0 0\n"
    d.document["cameras"] = {"file": "cameras.txt", "frames": [0]}


@CASES.add("cameras outside of the folder", refused=("cameras", "../../secret.txt"))
def _outside(d: Draft) -> None:
    d.files["secret.txt"] = b"0.0 0 0 0 0 0 0 1\n"
    d.document["cameras"] = {"file": "../../secret.txt", "frames": [0]}


@CASES.add("a huge place", refused=("parts[0].joint", "pivot", "1e+300"))
def _huge(d: Draft) -> None:
    d.door["joint"]["pivot"] = [1e300, 0, 0]


@CASES.add("a box far larger than anything", refused=("parts[0].collision[1]", "box pose", "1e+13"))
def _vast(d: Draft) -> None:
    b = box((0, 0, 0), (1, 1, 1))
    d.door["collision"].append({**b, "center": [0, 0, 1e13], "size": [1e13, 1, 1]})


@CASES.add("a range that does not hold the closed state", refused=("'door'", "range 0.2..1.2", "closed"))
def _offset(d: Draft) -> None:
    d.door["joint"].update(lower=0.2, upper=1.2)


@CASES.add("a range that ends before the closed state", refused=("'door'", "range -1..-0.5", "closed"))
def _before(d: Draft) -> None:
    d.door["joint"].update(lower=-1, upper=-0.5)
