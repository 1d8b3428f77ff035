"""What parts weigh and how they resist, as twin.json has it, both ways."""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.scene import Catch, Inertial, Part, PartPhysics, Quantity, origin_of
from twin.storage.node import Node


def inertial_document(p: Part) -> dict[str, Any] | None:
    """Mass, centre and tensor of a part as plain data."""
    if p.inertial is None:
        return None
    i, q, factors, box = (
        p.inertial.inertia,
        p.inertial.mass,
        p.inertial.inertia_interval,
        p.inertial.com_interval,
    )
    return {
        "mass": float(q.value),
        "com": p.inertial.com.tolist(),
        "inertia": [float(i[a, b]) for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
        "source": q.source,
        "mass_interval": [float(v) for v in q.interval],
        "inertia_source": p.inertial.inertia_source,
        "inertia_interval": None if factors is None else list(factors),
        "com_interval": None if box is None else box.tolist(),
    }


def physics_document(p: Part) -> dict[str, Any] | None:
    """Friction and resistance of a part as plain data; the key of a catch is there only with one."""
    if p.physics is None:
        return None
    numbers: dict[str, Any] = {k: _document(q) for k, q in p.physics.numbers.items()}
    catch = p.physics.catch
    if catch is not None:
        numbers["catch"] = {"force": _document(catch.force), "width": _document(catch.width)}
    return numbers


def _document(q: Quantity) -> dict[str, Any]:
    return {"value": float(q.value), "source": q.source, "interval": [float(v) for v in q.interval]}


def read_inertial(n: Node) -> Inertial:
    """Mass, centre and tensor of a part."""
    xx, yy, zz, xy, xz, yz = n.array("inertia", (6,))
    low, high = n.array("mass_interval", (2,))
    factors = None if n.value.get("inertia_interval") is None else n.array("inertia_interval", (2,))
    if not n.number("mass") > 0:
        raise n.error(f"must be positive, is {n.number('mass')} kg", "mass")
    with n.building():
        return Inertial(
            Quantity(n.number("mass"), _source(n, "source"), (float(low), float(high))),
            n.array("com", (3,)),
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
            "" if n.value.get("inertia_source") is None else _source(n, "inertia_source"),
            None if factors is None else (float(factors[0]), float(factors[1])),
            None if n.value.get("com_interval") is None else n.array("com_interval", (2, 3)),
        )


def _source(n: Node, key: str) -> str:
    """A source text. Twins made before sources began with a word are told by what was written then."""
    text = n.text(key)
    if origin_of(text) != "other":
        return text
    if text.startswith("surface area x thickness"):
        return f"geometry: {text}"
    return f"default: {text}" if "chosen by us" in text else text


def _quantity(n: Node) -> Quantity:
    low, high = n.array("interval", (2,))
    with n.building():
        return Quantity(n.number("value"), _source(n, "source"), (float(low), float(high)))


def read_physics(n: Node) -> PartPhysics:
    """Friction and resistance of a part, and its catch where it has one."""
    friction, damping, loss, density = (
        _quantity(n.child(k)) for k in ("friction", "damping", "frictionloss", "density")
    )
    catch = n.maybe("catch", _catch)
    with n.building():
        return PartPhysics(friction, damping, loss, density, catch)


def _catch(n: Node) -> Catch:
    force, width = (_quantity(n.child(k)) for k in ("force", "width"))
    with n.building():
        return Catch(force, width)
