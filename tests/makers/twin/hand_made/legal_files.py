"""Legal twins in unusual files: other programs' JSON and PLY, strange folders and texts."""

from __future__ import annotations

import json
import re
from typing import Any

from tests.makers.twin.hand_made.cases import Cases
from tests.makers.twin.hand_made.drafts import DOOR, FRAME, Draft, board, frame_boards, ply

CASES = Cases("legal")


@CASES.add("unknown keys at every level")
def _keys(d: Draft) -> None:
    note = {"who": "Grete", "n": 1, "list": [1, {"a": None}], "nested": {"deep": {"er": True}}}
    owners = (
        d.document,
        d.document["static"],
        d.door,
        *(d.door[k] for k in ("joint", "motion", "inertial", "contact")),
    )
    for k, owner in enumerate((*owners, d.door["physics"], d.door["physics"]["friction"])):
        owner["x_note"], owner[f"größe {k}"] = dict(note), k
    d.document["provenance"] = {"Herkunft": "Küche", "versions": {"blender": "4.2"}}
    d.document["static"]["collision"] = []
    d.door["collision"][0]["label"] = "front"


@CASES.add("stray photographs, notes and folders")
def _stray(d: Draft) -> None:
    d.files |= {
        "twin/photos/IMG 0001.JPG": b"\xff\xd8jpeg",
        "twin/photos/küche/Ünïcode – név.txt": "Öffnen".encode(),
        "twin/notes.md": b"mine",
        "twin/meshes/door.blend": b"BLENDER",
        "twin/meshes/door.collision.000.ply": b"not yours",
        "twin/.hidden/thumb": b"",
        "twin/twin.json.bak": b"{}",
        "twin/labels/readme.txt": b"none yet",
        "twin/files.json": b"{}",
        "notes.txt": b"beside twin/",
        "export_old/urdf/x.urdf": b"<robot/>",
        "export/my scene.xml": b"<mujoco/>",
        "export/mjcf/my_scene.xml": b"<mujoco/>",
        "export/urdf/launch/go.py": b"pass",
    }
    d.links["twin/photos/latest.jpg"] = "IMG 0001.JPG"
    d.links["twin/broken"] = "nowhere"
    d.document["static"]["collision"], d.door["collision"] = [], []


@CASES.add("meshes in folders with spaces and umlauts")
def _folders(d: Draft) -> None:
    d.door["mesh"] = d.shape("Scans vom Süden/Tür (final) #2.ply", board(*DOOR))
    d.document["static"]["mesh"] = d.shape("a/b/c/d/Körper & Rest.PLY", frame_boards())
    d.document["static"]["collision"] = []


@CASES.add("mesh paths with dots in them")
def _dots(d: Draft) -> None:
    d.door["mesh"], d.document["static"]["mesh"] = "./meshes/door.ply", "meshes/../meshes//frame.ply"


@CASES.add("a mesh that is a link within the folder")
def _link(d: Draft) -> None:
    d.shape("scans/v2.ply", board(*DOOR))
    del d.files["twin/meshes/door.ply"]
    d.links["twin/meshes/door.ply"] = "../scans/v2.ply"


@CASES.add("twin.json with CRLF and wide indentation")
def _crlf(d: Draft) -> None:
    d.indent = 8
    d.text = lambda text: text.replace("\n", "\r\n").encode()
    d.door["collision"] = []


@CASES.add("twin.json on one line in ASCII")
def _line(d: Draft) -> None:
    d.indent = None
    d.document["x_Küche"] = "weiß"
    d.text = lambda text: json.dumps(json.loads(text)).encode()


@CASES.add("whole numbers where others are expected")
def _whole(d: Draft) -> None:
    joint = d.door["joint"]
    joint["axis"], joint["lower"], joint["upper"] = [0, 0, -1], 0, 1
    d.door["inertial"].update(mass=4, mass_interval=[3, 5])
    d.door["motion"].update(residual=0, inliers=1)
    d.door["physics"]["friction"] = {"value": 1, "source": "user: by hand", "interval": [0, 2]}
    d.door["contact"]["width"] = 0


@CASES.add("numbers of many digits and with exponents")
def _digits(d: Draft) -> None:
    d.door["inertial"]["mass"] = 3.9999999999999996
    d.door["joint"]["upper"] = 1.4999999999999998
    d.text = lambda text: re.sub(r"(?<![\d.])0\.(\d)(?!\d)", r"0.000\1E+3", text).encode()


@CASES.add("words in other scripts where text is free")
def _unicode(d: Draft) -> None:
    d.document["recording"] = {"source": "キッチン/Küche 2 «été» 🚪", "frames": 9, "fingerprint": "ø" * 8}
    d.document["provenance"] = {
        "versions": {"スキャナ": "2"},
        "config": {"Ort": "Zürich", "emoji": "🧰", "quote": '"<&>\\'},
    }
    d.door["joint"]["limits_source"] = 'Bandmaß <2 mm> & "Auge"'
    d.door["inertial"]["source"] = "measured: Küchenwaage „Grete“ --> ±2 g ]]>"
    d.door["contact"]["source"] = "手で"


@CASES.add("meshes in single precision from another program")
def _float(d: Draft) -> None:
    more = [
        ("float", "nx"),
        ("float", "ny"),
        ("float", "nz"),
        ("float", "s"),
        ("float", "t"),
        ("uchar", "quality"),
    ]
    made: dict[str, Any] = {
        "scalar": "float",
        "index": "uint",
        "more": more,
        "comments": ["made by Scanner 3.1", "TextureFile a.png"],
    }
    d.shape("meshes/door.ply", ply(board(*DOOR), **made))
    d.shape("meshes/frame.ply", ply(frame_boards(), **made, colors=(9, 200, 30)))


@CASES.add("a PLY whose faces have the other usual name")
def _index(d: Draft) -> None:
    d.shape(
        "meshes/door.ply",
        ply(board(*DOOR), "float32", "int32", name="vertex_index", more=[("uchar", "alpha")]),
    )


@CASES.add("a PLY with a comment after its elements and data at its end")
def _tail(d: Draft) -> None:
    data = ply(board(*DOOR)).replace(b"end_header\n", b"comment last\nobj_info x\nend_header\n")
    d.shape("meshes/door.ply", data + b"trailing")


@CASES.add("an earlier report and manifest of another program")
def _manifest(d: Draft) -> None:
    d.files["manifest.json"] = b'{"not": "ours"}'
    d.files["config.toml"] = b"mine = true\n"
    d.files["replay/notes.txt"] = b"later"
    d.files["stages/mine.txt"] = b"mine"
    d.document["static"]["collision"] = [dict(b) for b in FRAME]


@CASES.add("a PLY with colours of faces and an element of its own")
def _faces(d: Draft) -> None:
    shape = board(*DOOR)
    head, _, _ = ply(shape).partition(b"end_header")
    vertices = shape.vertices.astype("<f8").tobytes()
    faces = b"".join(b"\x07\x03" + f.astype("<i4").tobytes() + b"\xff\x00\x10" for f in shape.faces)
    head = head.replace(b"property list", b"property uchar flags\nproperty list")
    head += b"".join(f"property uchar {c}\n".encode() for c in ("red", "green", "blue"))
    head += b"element material 1\nproperty float shine\nend_header\n"
    d.shape("meshes/door.ply", head + vertices + faces + bytes(4))
