"""What faults are planted into, and how: changes of elements, attributes and prims."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.scene import Box, Mesh, Twin

Xml = ET.Element
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
_FACES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))], np.int32)
# The cabinet is yawed by 0.5 rad: its right and its front in the world.
RIGHT, FRONT = np.array([np.cos(0.5), np.sin(0.5), 0.0]), np.array([np.sin(0.5), -np.cos(0.5), 0.0])


def lint_twin() -> Twin:
    """A cabinet with door, flap on the door, lid and drawer; the drawer collides by meshes, the rest by
    boxes."""
    twin = cabinet_twin(nested=True, lid=True)
    parts = tuple(
        replace(p, collision=tuple(as_mesh(b) for b in p.collision)) if p.name == "drawer" else p
        for p in twin.parts
    )
    return replace(twin, parts=parts)


def as_mesh(box: Box) -> Mesh:
    return Mesh(geo.transform(box.T_world_box, _CORNERS * box.size), _FACES)


@dataclass(frozen=True)
class Mutation:
    """`plant(main file)` makes one fault, which `rule` must find."""

    format: str
    rule: str
    name: str
    plant: Callable[[Path], None]

    @property
    def id(self) -> str:
        return f"{self.format}-{self.rule}-{self.name}".replace(" ", "-")


class Mutations(list[Mutation]):
    """Faults of one subject, in the order in which they are written."""

    def xml(self, fmt: str, rule: str, name: str) -> Callable[[Callable[[Xml, Path], None]], None]:
        """Register a change of a URDF's or MJCF's tree."""

        def register(change: Callable[[Xml, Path], None]) -> None:
            def plant(path: Path) -> None:
                root = ET.fromstring(path.read_text(encoding="utf-8"))  # noqa: S314  (a file this test wrote)
                change(root, path.parent)
                path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")

            self.append(Mutation(fmt, rule, name, plant))

        return register

    def usd(self, rule: str, name: str) -> Callable[[Callable[[Any, Path], None]], None]:
        """Changes are opinions in the root layer, the strongest, wherever the fact itself is written."""

        def register(change: Callable[[Any, Path], None]) -> None:
            def plant(path: Path) -> None:
                from pxr import Usd

                stage = Usd.Stage.Open(str(path))
                change(stage, path.parent)
                stage.GetRootLayer().Save()

            self.append(Mutation("usd", rule, name, plant))

        return register

    def add(self, fmt: str, rule: str, name: str, change: Callable[[Any, Path], None]) -> None:
        """Register a change of either."""
        (self.usd(rule, name) if fmt == "usd" else self.xml(fmt, rule, name))(change)


def set_(where: str, **values: str) -> Callable[[Xml, Path], None]:
    """Set attributes of the element at an ElementTree path."""

    def change(root: Xml, _: Path) -> None:
        e = root.find(where)
        assert e is not None, where
        for k, v in values.items():
            e.set(k.rstrip("_"), v)

    return change


def drop(where: str, *keys: str) -> Callable[[Xml, Path], None]:
    """Remove attributes of the element at a path, or all elements there."""

    def change(root: Xml, _: Path) -> None:
        found = root.findall(where)
        assert found, where
        for e in found:
            for k in keys:
                del e.attrib[k]
            if not keys:
                parent = next(p for p in root.iter() if e in list(p))
                parent.remove(e)

    return change


def attr(path: str, name: str, value: Any) -> Callable[[Any, Path], None]:
    """Set an attribute of the prim whose path ends with `path`; None blocks it."""

    def change(stage: Any, _: Path) -> None:
        a = prim(stage, path).GetAttribute(name)
        assert a, (path, name)
        if value is None:
            a.Block()
        else:
            a.Set(value(a.Get()) if callable(value) else value)

    return change


def prim(stage: Any, ending: str) -> Any:
    found = [p for p in stage.Traverse() if str(p.GetPath()).endswith(ending)]
    assert len(found) == 1, (ending, found)
    return found[0]


def meta(key: str, value: Any) -> Callable[[Any, Path], None]:
    return lambda stage, _: stage.ClearMetadata(key) if value is None else stage.SetMetadata(key, value)


def shift(values: Any, offset: Any) -> str:
    return " ".join(
        repr(float(x)) for x in np.array([float(v) for v in str(values).split()]) + np.asarray(offset)
    )


def each(where: str, change: Callable[[Any], None]) -> Callable[[Xml, Path], None]:
    """Change every element at an ElementTree path; there is one at least."""

    def plant(root: Xml, _: Path) -> None:
        found = root.findall(where)
        assert found, where
        for e in found:
            change(e)

    return plant


U_DOOR, M_DOOR = "joint[@name='door_joint']", ".//joint[@name='door_joint']"
U_DRAWER, M_DRAWER = "link[@name='drawer']", ".//body[@name='drawer']"
