"""trajectory.json (everything, readable) and trajectory.npz (the arrays), the project's own form."""

from __future__ import annotations

import io
import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from robots.floor import Floor
from robots.formats.trajectory_export import PlannedMotion
from robots.trajectory import RejectedBase, RobotTrajectory
from twin.errors import InputError, PlanningError
from twin.files.atomic import put, staging
from twin.files.paths import AnyPath
from twin.scene import Part
from twin.verdict import verdict_document

FORMAT = "funtwin-trajectory/1"
_AGAIN = "plan it again with `twin replay`"
_ARRAYS = (
    "times", "q", "qd", "gripper", "part_state", "T_world_tool", "position_error", "T_world_base", "limits",
    "velocity_limits", "effort",
)  # fmt: skip


def save(trajectory: RobotTrajectory, folder: AnyPath) -> tuple[Path, Path]:
    """Write trajectory.json and trajectory.npz into `folder`; returns their paths.

    Both take their places at once. Raises InputError when the folder can't be written.
    """
    folder = Path(folder)
    json_path, npz_path = folder / "trajectory.json", folder / "trajectory.npz"
    try:
        with staging(folder) as staged:
            (staged / json_path.name).write_bytes(json_bytes(trajectory))
            (staged / npz_path.name).write_bytes(npz_bytes(trajectory))
            put(staged, folder, (json_path.name, npz_path.name))
    except OSError as e:
        raise InputError(f"{folder} can't be written ({e.strerror})", "choose another output folder") from e
    return json_path, npz_path


def render_json(source: PlannedMotion) -> dict[str, bytes]:
    """trajectory.json alone."""
    return {"trajectory.json": json_bytes(source.trajectory, source.part)}


def render_npz(source: PlannedMotion) -> dict[str, bytes]:
    """trajectory.npz alone."""
    return {"trajectory.npz": npz_bytes(source.trajectory, source.part)}


def json_bytes(trajectory: RobotTrajectory, part: Part | None = None) -> bytes:
    """Contents of trajectory.json; arrays to nine decimals. part: moved, its verdict first."""
    document: dict[str, Any] = {"format": FORMAT}
    if part is not None and part.verdict is not None:
        document["verdict"] = verdict_document(part.verdict)
    for f in fields(trajectory):
        value = getattr(trajectory, f.name)
        if isinstance(value, np.ndarray):
            value = np.round(value, 9).tolist()
        elif f.name == "rejected":
            value = [asdict(r) for r in value]
        elif isinstance(value, Floor):
            value = asdict(value)
        document[f.name] = value
    return (json.dumps(document, indent=None, allow_nan=False) + "\n").encode()


def npz_bytes(trajectory: RobotTrajectory, part: Part | None = None) -> bytes:
    """Contents of trajectory.npz: arrays, phases (n,) as text and any verdict on the part as a line."""
    out = io.BytesIO()
    arrays: dict[str, Any] = {name: getattr(trajectory, name) for name in _ARRAYS}
    if part is not None and part.verdict is not None:
        arrays["verdict"] = np.array(part.verdict.text)
    np.savez_compressed(out, phases=np.array(trajectory.phases), **arrays)
    return out.getvalue()


def load(path: AnyPath) -> RobotTrajectory:
    """Read a trajectory.json.

    Raises InputError when the file is missing, of another format, or breaks the laws of a trajectory.
    """
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as e:
        raise InputError(f"{path} can't be read ({e.strerror})", "give a trajectory.json") from e
    except (json.JSONDecodeError, UnicodeDecodeError) as e:
        raise InputError(f"{path} is not JSON: {e}", _AGAIN) from e
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"{path} is not of format {FORMAT}", _AGAIN)
    values: dict[str, Any] = {f.name: document.get(f.name) for f in fields(RobotTrajectory)}
    missing = [name for name, value in values.items() if value is None and name != "floor"]
    if missing:
        raise InputError(f"{path} lacks {', '.join(missing)}", _AGAIN)
    try:
        for name in _ARRAYS:
            values[name] = np.asarray(values[name], dtype=np.float64)
        values["rejected"] = tuple(
            RejectedBase(**{**r, "position": tuple(r["position"])}) for r in values["rejected"]
        )
        values["joint_names"], values["phases"] = tuple(values["joint_names"]), tuple(values["phases"])
        if values["floor"] is not None:
            values["floor"] = Floor(float(values["floor"]["height"]), values["floor"]["source"])
        return RobotTrajectory(**values)
    except (TypeError, ValueError, KeyError, PlanningError, InputError) as e:
        raise InputError(f"{path} does not hold a valid trajectory: {e}") from e
