"""URDF text as yourdfpy parses it; faults are named before it stumbles over them, capsules are put back."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from twin.errors import InputError
from twin.importers.linted import errors
from twin.lint.xml import read_xml

# Shapes and the attributes that each must have.
_SHAPES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("filename",),
}
_ROLES = ("visual", "collision")


@dataclass(frozen=True)
class Capsule:
    """A cylinder with half spheres on its ends, m; `length` is that of the cylinder."""

    radius: float
    length: float


def parsed(path: Path) -> Any:
    """yourdfpy's robot, a capsule as `capsule` of its geometry. Raises InputError by the element."""
    root, lines = read_xml(path)  # refuses document types, which the parser of yourdfpy would follow
    for element, problem in _malformed(root):
        name = f" {element.get('name')!r}" if element.get("name") else ""
        where = f"<{element.tag}>{name} (line {lines[element]})"
        raise InputError(f"{path} can't be read as URDF: {where} {problem}", "correct it in the file")
    capsules = {g for e in root.iter("geometry") for g in e.findall("capsule")}
    for shape in capsules:
        shape.tag = "cylinder"
    robot = _by_yourdfpy(path, ET.tostring(root))
    for element, link in zip(root.findall("link"), robot.links, strict=True):
        for role, known in zip(_ROLES, (link.visuals, link.collisions), strict=True):
            for written, read in zip(element.findall(role), known, strict=True):
                if not capsules.isdisjoint(written.iter()):
                    stand_in, read.geometry.cylinder = read.geometry.cylinder, None
                    read.geometry.capsule = Capsule(stand_in.radius, stand_in.length)
    return robot


def _by_yourdfpy(path: Path, text: bytes) -> Any:
    import yourdfpy

    quiet = logging.getLogger("yourdfpy.urdf")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # what it warns about is told here, or has no weight for a twin
    try:
        return yourdfpy.URDF.load(
            BytesIO(text), build_scene_graph=False, load_meshes=False, load_collision_meshes=False
        ).robot
    except Exception as e:  # the parser's errors have no common base, and name no element
        told = errors(path, ("number-unreadable",)) or (" ".join(f"{type(e).__name__}: {e}".split())[:200],)
        raise InputError(f"{path} can't be read as URDF: {told[0]}", "correct it in the file") from e
    finally:
        quiet.setLevel(level)


def _malformed(root: ET.Element) -> Iterator[tuple[ET.Element, str]]:
    """Elements that lack what URDF demands of them, and what that is."""
    yield from _lacks(root, ("name",))
    for link in root.findall("link"):
        yield from _lacks(link, ("name",))
        for shape in (s for role in _ROLES for s in link.findall(role)):
            geometry = shape.find("geometry")
            kinds = [] if geometry is None else [g.tag for g in geometry]
            if len(kinds) != 1 or kinds[0] not in _SHAPES:
                has = ", ".join(f"<{k}>" for k in kinds) or "none"
                of = ", ".join(f"<{k}>" for k in _SHAPES)
                yield shape, f"of link {link.get('name')!r} must have one shape of {of}, and has {has}"
            elif geometry is not None:
                yield from _lacks(geometry[0], _SHAPES[kinds[0]])
    for joint in root.findall("joint"):
        yield from _lacks(joint, ("name", "type"))
        for end in ("parent", "child"):
            body = joint.find(end)
            if body is None or body.get("link") is None:
                yield joint, f"names no {end} link"


def _lacks(element: ET.Element, needed: tuple[str, ...]) -> Iterator[tuple[ET.Element, str]]:
    for key in needed:
        if element.get(key) is None:
            yield element, f"has no attribute {key!r}"
