"""Loads a file into MuJoCo as its author would, meshes found where its text says."""

from __future__ import annotations

import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mujoco

from twin.lint.meshes import locate
from twin.lint.xml import read_xml

_READABLE = (".obj", ".stl", ".msh")


def load(path: Path, fmt: str) -> Any:
    """The specification, nothing fused or discarded. ValueError as MuJoCo says; LookupError if not asked."""
    if fmt == "usd":
        import_module("mujoco._usd")  # registers the schemas: before any other use of pxr in this process
    if fmt == "urdf":
        with tempfile.TemporaryDirectory() as folder:
            plain = Path(folder) / "model.urdf"
            plain.write_bytes(_plain_urdf(path))
            spec = mujoco.MjSpec.from_file(str(plain))
            return spec
    return mujoco.MjSpec.from_file(str(path))


def _plain_urdf(path: Path) -> bytes:
    """The URDF without visuals, with absolute mesh paths, and with settings that keep every link."""
    root, _ = read_xml(path)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for mesh in root.iter("mesh"):
        found = locate(mesh.get("filename", ""), path.parent)
        if found is None:
            raise LookupError(f"{mesh.get('filename')!r} can't be found from here")
        if found.suffix.lower() not in _READABLE:
            raise LookupError(f"MuJoCo reads no {found.suffix} meshes ({found.name})")
        mesh.set("filename", str(found.resolve()))
    for old in root.findall("mujoco"):
        root.remove(old)
    settings = {
        "fusestatic": "false",
        "strippath": "false",
        "balanceinertia": "false",
        "discardvisual": "false",
    }
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", settings)
    return ET.tostring(root)
