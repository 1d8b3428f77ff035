"""A closed-form cabinet, its truth on disk, and exports of it that are exact or spoilt on purpose."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.scenes.boards import (
    Board,
    cabinet_twin,
    carcass_boards,
    door_boards,
    drawer_boards,
    world_from_cabinet,
)
from twin import geometry as geo
from twin.files.ply import ply_bytes
from twin.geometry import Array
from twin.scene import Prismatic
from twin.storage import save

T = world_from_cabinet()
_PLACE = geo.make_pose(
    geo.exp_so3([0.1, -0.2, 0.3]), [0.2, -0.1, 0.3]
)  # of the parts' bodies: no frame of their own is the world's
TWIN = cabinet_twin(T)
BODIES = {"static": carcass_boards(), "door": door_boards(), "drawer": drawer_boards()}
FLOOR, LEFT, RIGHT, BACK, BAR = (drawer_boards()[k] for k in range(1, 6))


@dataclass(frozen=True)
class Geom:
    """A board as a geom of an export; name: behind the body's and an underscore."""

    name: str
    board: Board


def drawn(boards: Sequence[Board]) -> list[Geom]:
    """Boards as what was seen and as colliders."""
    return [Geom(f"{kind}_{k}", b) for kind in ("visual", "collision") for k, b in enumerate(boards)]


def write_run(
    run: Path, bodies: Mapping[str, Sequence[Geom]] | None = None, T_asset_twin: Array | None = None
) -> Path:
    """A run folder with the twin, and an export of boxes by body: by default the exact one."""
    save(TWIN, run / "twin")
    T_asset = np.eye(4) if T_asset_twin is None else T_asset_twin
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    static = spec.worldbody.add_body(name="static")
    shown = {name: drawn(boards) for name, boards in BODIES.items()} | dict(bodies or {})
    for name, geoms in shown.items():
        part = name not in ("static", "room")
        place = _PLACE if part else np.eye(4)
        body = static if name == "static" else static.add_body(name=name, pos=place[:3, 3], quat=_quat(place))
        if part:
            _add_joint(body, name, geo.invert_pose(place) @ T_asset)
        for g in geoms:
            box = g.board.box(geo.invert_pose(place) @ T_asset @ T)
            visual = not g.name.startswith(("collision", "handle_collision"))
            body.add_geom(
                name=f"{name}_{g.name}", type=mujoco.mjtGeom.mjGEOM_BOX, size=box.size / 2, pos=box.T_world_box[:3, 3],
                quat=_quat(box.T_world_box), group=2 if visual else 3,
                contype=0 if visual else 1, conaffinity=0 if visual else 1,
            )  # fmt: skip
        if not geoms:  # something that weighs, in a group that is neither drawn nor touched
            body.add_geom(size=[0.01, 0, 0], group=4, contype=0, conaffinity=0)
    for part in TWIN.parts:
        spec.add_exclude(bodyname1="static", bodyname2=part.name)
    path = run / "export" / "mjcf" / f"{TWIN.name}.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    spec.compile()
    path.write_text(spec.to_xml())
    return run


def _quat(pose: Array) -> Array:
    return geo.quat_wxyz_from_matrix(pose[:3, :3])


def _add_joint(body: mujoco.MjsBody, name: str, T_asset: Array) -> None:
    joint = TWIN.part(name).joint.transformed(T_asset)
    slides = isinstance(joint, Prismatic)
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
    pivot = np.zeros(3) if isinstance(joint, Prismatic) else joint.pivot
    body.add_joint(
        name=f"{name}_joint", type=kind, axis=joint.axis, pos=pivot, range=[0.0, joint.upper], limited=True
    )


def write_truth(recording: Path) -> Path:
    """The folder truth/ by which the twin is right in everything."""
    folder = recording / "truth"
    folder.mkdir(parents=True)
    frames = 60
    parts, poses = [], {}
    for part in TWIN.parts:
        assert part.contact is not None
        joint, out = part.joint, part.contact.rotation[:, 2]
        states = part.motion.state
        poses[f"part_{part.id}"] = joint.poses(states)
        (folder / f"part_{part.id}.ply").write_bytes(ply_bytes(part.mesh))
        (folder / f"furniture_{part.id}.ply").write_bytes(ply_bytes(TWIN.static.mesh))
        grip = {
            "point_world": (part.contact.point - 0.006 * out).tolist(),
            "along_world": part.contact.rotation[:, 1].tolist(),
            "outward_world": out.tolist(),
            "width": 0.012,
            "source": "handle",
        }
        parts.append(
            {
                "id": part.id, "name": part.name, "type": joint.kind, "axis_world": joint.axis.tolist(),
                "pivot_world": None if isinstance(joint, Prismatic) else joint.pivot.tolist(),
                "states": states.tolist(), "motion_segments": [[10, frames - 10]], "grip": grip,
            }
        )  # fmt: skip
    np.savez(folder / "part_poses.npz", **poses)  # type: ignore[arg-type]
    (folder / "static.ply").write_bytes(ply_bytes(TWIN.static.mesh))
    (folder / "truth.json").write_text(json.dumps({"frames": frames, "parts": parts}))
    assert TWIN.cameras is not None
    lines = []
    for k in range(frames):
        pose = TWIN.cameras.pose(k)
        pose = TWIN.cameras.T_world_cam[0] if pose is None else pose
        w, x, y, z = geo.quat_wxyz_from_matrix(pose[:3, :3])
        lines.append(" ".join(str(float(v)) for v in (k / 15, *pose[:3, 3], x, y, z, w)))
    (folder / "trajectory.txt").write_text("\n".join(lines) + "\n")
    return folder


def without(twin_body: str, *left_out: Board) -> dict[str, list[Geom]]:
    """A body without some of its boards."""
    return {twin_body: drawn([b for b in BODIES[twin_body] if b not in left_out])}
