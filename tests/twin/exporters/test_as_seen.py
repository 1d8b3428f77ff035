"""What was seen is exported to the byte as it was before anything was inferred: the digests stem from code
that knew of no inferred layer. Numbers in text count to nine digits after the point: the rest is the
processor's."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.completion.asset import AS_SEEN
from twin.exporters import export
from twin.scene import Mesh, Twin

KNOWN = json.loads(Path(__file__).with_name("as_seen.json").read_text())


def scanned(mesh: Mesh) -> Mesh:
    """A closed mesh with holes, as scans have them."""
    keep = np.arange(len(mesh.faces)) % 7 != 0
    return Mesh(mesh.vertices, mesh.faces[keep], mesh.colors)


def stated_and_scanned() -> dict[str, Twin]:
    """A cabinet with shapes, and its scan without any."""
    twin = cabinet_twin(nested=True, lid=True)
    static = replace(twin.static, mesh=scanned(twin.static.mesh), collision=())
    parts = tuple(replace(p, mesh=scanned(p.mesh), collision=()) for p in twin.parts)
    return {"stated": twin, "scanned": replace(twin, static=static, parts=parts)}


def digest_of(path: Path) -> str:
    data = path.read_bytes()
    if path.suffix in (".urdf", ".xml", ".usda"):
        data = re.sub(rb"-?\d+\.\d+(e-?\d+)?", lambda m: b"%.9f" % (round(float(m[0]), 9) + 0.0), data)
    return hashlib.sha256(data).hexdigest()[:16]


@pytest.mark.parametrize("name", ["stated", "scanned"])
def test_seen_kept_and_in_the_camera_s_frame_is_as_before(name: str, tmp_path: Path) -> None:
    export(stated_and_scanned()[name], tmp_path, view=AS_SEEN)
    files = {f"{name}/{p.relative_to(tmp_path)}": p for p in tmp_path.rglob("*") if p.is_file()}
    found = {k: digest_of(p) for k, p in files.items() if k in KNOWN}
    assert found == {k: v for k, v in KNOWN.items() if k.startswith(f"{name}/")}
    assert {Path(k).name for k in files} - {Path(k).name for k in KNOWN} == {
        "README.md",
        "files.json",
        "cabinet.usda.png",
    }
