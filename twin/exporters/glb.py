"""glTF 2.0 writer, one binary file: a node a link, its joint in the node's `extras`, two animations.

glTF is y up, so the first node turns the twin's world. A part's node sits at its link's origin and turns or
slides there; what is drawn hangs below it, a node a visual. Specification: Khronos, glTF 2.0 (ISO 12113).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.exporters.asset import AssetInfo
from twin.exporters.glb_buffer import GlbBuffer
from twin.exporters.glb_mesh import add_mesh
from twin.exporters.links import Link, Tree, TreeJoint, Visual
from twin.geometry import Array
from twin.inferred import box_mesh
from twin.scene import Mesh
from twin.verdict import verdict_document

# s from closed to open; chosen by us: a drawer pulled without haste
_OPENING_S = 2.0
# rad between keys: between two of them readers take the shorter way around. Chosen by us.
_KEY = 1.0
_Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # xyzw, a quarter turn back about x
COLLISION = "collision"


def write(tree: Tree, folder: Path, asset: AssetInfo) -> tuple[Path, list[str]]:
    """Write `<name>.glb` into `folder`; returns the path and what glTF can't carry."""
    path = folder / f"{tree.name}.glb"
    path.write_bytes(glb(tree, asset))
    return path, [
        "glb: masses, friction and collision shapes are not carried (glTF shows, it does not simulate)"
    ]


def glb(tree: Tree, asset: AssetInfo, light: bool = False, shapes: bool = False) -> bytes:
    """The file's content. light: one normal a vertex, also at creases, for half as many vertices to draw.
    shapes: with collision shapes, as nodes `<link>_collision` below their links."""
    buffer = GlbBuffer()
    nodes: list[dict[str, Any]] = [{"name": tree.name, "rotation": _Y_UP}]
    at: dict[str, int] = {}
    for link in tree.links:
        at[link.name] = len(nodes)
        nodes.append(_node(link))
        shown = [*link.visuals, *(_collision(link) if shapes else ())]
        children = [_append(nodes, buffer, v, light) for v in shown if len(v.mesh.faces)]
        _hang(nodes, at[link.name], children)
    for link in tree.links:
        _hang(nodes, 0 if link.parent is None else at[link.parent], [at[link.name]])
    animations = [
        found
        for name, keys in (("open", _opening), ("recorded", _recorded))
        if (
            found := _animation(
                name, [(at[k.name], k, keys(k.joint)) for k in tree.moving if k.joint], buffer
            )
        )
    ]
    document: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": "Funtwin",
            "copyright": f"{asset.author}, licence {asset.license}",
            "extras": {"source": tree.source, "told": tree.told, "verdict": verdict_document(tree.verdict)},
        },
        "scene": 0,
        "scenes": [{"name": tree.name, "nodes": [0]}],
        "nodes": nodes,
    }
    return buffer.file(document | ({"animations": animations} if animations else {}))


def _node(link: Link) -> dict[str, Any]:
    told: dict[str, Any] = {"link": link.name, "kind": link.kind}
    if link.joint is not None:
        j = link.joint
        unit = "rad" if j.kind == "revolute" else "m"
        told["joint"] = {
            "name": j.name, "type": j.kind, "axis": _floats(j.axis), "lower": j.lower, "upper": j.upper, "unit": unit,
        }  # fmt: skip
    return {"name": link.name, "translation": _floats(link.offset), "extras": told}


def _append(nodes: list[dict[str, Any]], buffer: GlbBuffer, shown: Visual, light: bool) -> int:
    told = {"basis": shown.basis, "role": shown.role, "reason": shown.reason}
    nodes.append(
        {
            "name": shown.name,
            "mesh": add_mesh(buffer, shown, light),
            "extras": {k: v for k, v in told.items() if v},
        }
    )
    return len(nodes) - 1


def _hang(nodes: list[dict[str, Any]], parent: int, children: Sequence[int]) -> None:
    if children:
        nodes[parent].setdefault("children", []).extend(children)


def _collision(link: Link) -> list[Visual]:
    """The collision shapes of a link as things to draw."""
    return [
        Visual(name, s if isinstance(s, Mesh) else box_mesh(s.T_world_box, s.size), role=COLLISION)
        for name, s in link.shapes.items()
    ]


def _opening(joint: TreeJoint) -> tuple[Array, Array]:
    """Times (n,) s and states (n,) from closed to open and back."""
    steps = max(1, int(np.ceil((joint.upper - joint.lower) / _KEY)))
    there = np.linspace(joint.lower, joint.upper, steps + 1)
    states = np.concatenate([there, there[-2::-1]])
    return np.linspace(0.0, 2.0 * _OPENING_S, len(states)), states


def _recorded(joint: TreeJoint) -> tuple[Array, Array]:
    return joint.times, joint.states


def _animation(
    name: str, moves: Sequence[tuple[int, Link, tuple[Array, Array]]], buffer: GlbBuffer
) -> dict[str, Any] | None:
    """An animation of all joints that have keys: nodes, links, and times (n,) and states (n,)."""
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for node, link, (times, states) in moves:
        if link.joint is None or len(times) < 2:
            continue
        path, values = joint_motion(link, link.joint, states)
        samplers.append({
            "input": buffer.accessor(times[:, None].astype(np.float32), bounds=True),
            "output": buffer.accessor(values.astype(np.float32)),
            "interpolation": "LINEAR",
        })  # fmt: skip
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    return {"name": name, "samplers": samplers, "channels": channels} if channels else None


def joint_motion(link: Link, joint: TreeJoint, states: Array) -> tuple[str, Array]:
    """Which property of a link's node its joint sets, and its values at states (n,): quaternions xyzw (n, 4)
    or translations (n, 3) m."""
    if joint.kind == "prismatic":
        return "translation", link.offset + states[:, None] * joint.axis
    half = states[:, None] / 2
    return "rotation", np.concatenate([np.sin(half) * joint.axis, np.cos(half)], axis=1)


def _floats(values: Array) -> list[float]:
    return [float(v) + 0.0 for v in values]
