"""The content of twin.json (format "funtwin/1") as plain data: a twin's own, and others' additions."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.scene import Joint, Mesh, Part, Revolute, Twin
from twin.storage.completion import (
    completion_document,
    completion_files,
    shapes_document,
    with_completion_named,
)
from twin.storage.physics import inertial_document, physics_document
from twin.storage.texture import texture_document, with_texture_named
from twin.verdict import verdict_document

FORMAT = "funtwin/1"
CAMERAS = "cameras.txt"


def twin_document(twin: Twin, meshes: dict[str, Mesh]) -> dict[str, Any]:
    """The content of twin.json; each mesh named is added to `meshes` under its path relative to twin.json."""
    static = twin.static
    meshes[f"meshes/{static.name}.ply"] = static.mesh
    r = twin.recorded
    document = {
        "format": FORMAT,
        "name": twin.name,
        "verdict": verdict_document(twin.verdict),
        "recording": None
        if r is None
        else {"source": r.source, "frames": r.frames, "fingerprint": r.fingerprint},
        "provenance": dict(twin.provenance),
        "cameras": None
        if twin.cameras is None
        else {"file": CAMERAS, "frames": twin.cameras.frames.tolist()},
        "static": {
            "name": static.name,
            "mesh": f"meshes/{static.name}.ply",
            "collision": shapes_document(f"{static.name}.collision", static.collision, meshes),
            **texture_document(static.name, static.mesh.texture),
            **completion_document(static.name, static.completion, meshes),
        },
        **({"filtered_pairs": [list(pair) for pair in twin.filtered_pairs]} if twin.filtered_pairs else {}),
        "parts": [with_extra(_part(p, meshes), p.extra) for p in twin.parts],
    }
    return with_extra(document, twin.extra)


def _part(p: Part, meshes: dict[str, Mesh]) -> dict[str, Any]:
    meshes[f"meshes/{p.name}.ply"] = p.mesh
    m = p.motion
    return {
        "id": p.id,
        "name": p.name,
        "parent": p.parent,
        "verdict": verdict_document(p.verdict),
        "mesh": f"meshes/{p.name}.ply",
        "collision": shapes_document(f"{p.name}.collision", p.collision, meshes),
        "joint": _joint(p, p.joint),
        "motion": {
            "frames": m.frames.tolist(),
            "times": m.times.tolist(),
            "state": m.state.tolist(),
            "intervals": [list(i) for i in m.intervals],
            "residual": float(m.residual),
            "inliers": float(m.inliers),
        },
        "inertial": inertial_document(p),
        "physics": physics_document(p),
        "contact": _contact(p),
        **_handle(p),
        **texture_document(p.name, p.mesh.texture),
        **completion_document(p.name, p.completion, meshes),
    }


def part_document(part: Part) -> dict[str, Any]:
    """What twin.json says about a part."""
    return _part(part, {})


def extra_of(raw: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """What `raw` says under keys that `known` lacks, at any depth of objects within objects."""
    extra = {}
    for key, value in raw.items():
        if key not in known:
            extra[key] = value
        elif isinstance(value, dict) and isinstance(known[key], dict):
            inner = extra_of(value, known[key])
            extra |= {key: inner} if inner else {}
    return extra


def with_extra(known: Mapping[str, Any], extra: Mapping[str, Any]) -> dict[str, Any]:
    """The inverse of `extra_of`: `known`, and after it what only `extra` says."""
    out = dict(known)
    for key, value in extra.items():
        if key not in out:
            out[key] = value
        elif isinstance(out[key], dict) and isinstance(value, Mapping):
            out[key] = with_extra(out[key], value)
    return out


def with_changes(
    raw: Mapping[str, Any], before: Mapping[str, Any], after: Mapping[str, Any]
) -> dict[str, Any]:
    """`raw` with all that differs between two documents, without what only the first has; else as in `raw`.

    Parts are matched by their id.
    """
    out = {key: value for key, value in raw.items() if key in after or key not in before}
    for key, value in after.items():
        old, mine = before.get(key), raw.get(key)
        if value == old:
            continue
        if key == "parts":
            was, now = ({p["id"]: p for p in parts} for parts in (old or [], value))
            out[key] = [
                with_changes(p, was[p["id"]], now[p["id"]]) if p["id"] in was and p["id"] in now else p
                for p in raw[key]
            ]
        elif isinstance(value, dict) and isinstance(old, dict) and isinstance(mine, dict):
            out[key] = with_changes(mine, old, value)
        else:
            out[key] = value
    return out


def shape_files(document: Mapping[str, Any]) -> Iterator[tuple[tuple[int | None, int | str | None], str]]:
    """Mesh files of a document: ((part id or None for the static scene, None for the mesh itself, the number
    of a collision shape, or where in the inferred layer it stands), path)."""
    for owner in (document["static"], *document["parts"]):
        yield (owner.get("id"), None), owner["mesh"]
        for k, shape in enumerate(owner["collision"]):
            if isinstance(shape, str):
                yield (owner.get("id"), k), shape
        for where, path in completion_files(owner.get("completion")):
            yield (owner.get("id"), where), path


def with_files_named(document: Mapping[str, Any], name: Callable[[str], str]) -> dict[str, Any]:
    """The document with every file of a mesh or texture called `name(path)`."""

    def renamed(owner: Mapping[str, Any]) -> dict[str, Any]:
        shapes = [name(s) if isinstance(s, str) else s for s in owner["collision"]]
        named = {**owner, "mesh": name(owner["mesh"]), "collision": shapes, **with_texture_named(owner, name)}
        if owner.get("completion") is not None:
            named["completion"] = with_completion_named(owner["completion"], name)
        return named

    parts = [renamed(p) for p in document["parts"]]
    return {**document, "static": renamed(document["static"]), "parts": parts}


def _joint(p: Part, j: Joint) -> dict[str, Any]:
    s = j.sigma
    return {
        "type": j.kind,
        "axis": j.axis.tolist(),
        "pivot": j.pivot.tolist() if isinstance(j, Revolute) else None,
        "lower": float(j.lower),
        "upper": float(j.upper),
        "limits_source": p.limits_source,
        "closed_source": p.closed_source,
        "type_source": p.type_source,
        "sigma": None
        if s is None
        else {"axis_deg": float(f"{np.rad2deg(s.axis):.12g}"), "pivot_m": s.pivot, "state": float(s.state)},
        "covariance": None if j.covariance is None else j.covariance.tolist(),
    }


def _handle(p: Part) -> dict[str, Any]:
    """{"handle": its section}, empty where none was measured."""
    h = p.handle
    if h is None:
        return {}
    told = {"middle": h.middle.tolist(), "width": float(h.width), "photographs": h.photographs}
    return {"handle": told}


def _contact(p: Part) -> dict[str, Any] | None:
    c = p.contact
    if c is None:
        return None
    return {
        "point": c.point.tolist(),
        "rotation": c.rotation.tolist(),
        "width": float(c.width),
        "frames": [int(f) for f in c.frames],
        "source": c.source,
    }


def json_text(value: Any, indent: int = 0) -> str:
    """JSON, one line a list of plain values, indentation for the rest; refuses NaN and infinity."""
    pad = " " * (indent + 1)
    if isinstance(value, dict) and value:
        rows = [
            f"{pad}{json.dumps(str(k), ensure_ascii=False)}: {json_text(v, indent + 1)}"
            for k, v in value.items()
        ]
        return "{\n" + ",\n".join(rows) + "\n" + " " * indent + "}"
    if isinstance(value, list | tuple) and any(isinstance(v, dict | list | tuple) for v in value):
        rows = [pad + json_text(v, indent + 1) for v in value]
        return "[\n" + ",\n".join(rows) + "\n" + " " * indent + "]"
    try:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as e:
        raise InputError(
            f"twin.json can't hold the value {value!r}", "use finite numbers and JSON types only"
        ) from e


def read_document(file: Path) -> dict[str, Any]:
    """The object in a twin.json as it stands. Raises InputError when it is no JSON object of this format."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=_unambiguous)
    except (OSError, ValueError, RecursionError) as e:
        raise InputError(f"{file} is not readable JSON: {e}", "save the twin again") from e
    if not isinstance(document, dict):
        raise InputError(
            f"{file}: document must be an object, is {document!r:.60}", "see docs/twin_format.md"
        )
    return document


def _unambiguous(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object. Raises ValueError for a key that stands twice: readers differ in which they take."""
    out = dict(pairs)
    if len(out) < len(pairs):
        twice = next(k for n, (k, _) in enumerate(pairs) if k in dict(pairs[:n]))
        raise ValueError(f"the key {twice!r:.60} stands twice in one object")
    return out
