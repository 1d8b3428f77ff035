"""LeRobot dataset, layout v3.0, with the trajectory as its one episode. Needs pyarrow (extra `lerobot`).

Source of the layout: LeRobot's documentation of LeRobotDataset v3.0 and huggingface/lerobot,
src/lerobot/datasets/ (dataset_metadata.py, feature_utils.py, io_utils.py): meta/info.json, meta/stats.json,
meta/tasks.parquet (its pandas index is the task), meta/episodes and data in chunk-CCC/file-FFF.parquet, one
row group an episode.

The states are the planned ones, not measured: an episode to start from, to merge or to test a reader on.
"""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robots.formats.trajectory_export import PlannedMotion, smooth_quaternions_wxyz
from robots.trajectory import PHASES
from twin import geometry as geo
from twin.errors import MissingDependencyError
from twin.geometry import Array
from twin.packages import to_install

if TYPE_CHECKING:
    import pyarrow as pa

FPS = 30  # frames per second, as most published datasets have; chosen by us
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIRST = {"chunk_index": 0, "file_index": 0}
FILES = tuple(
    f"lerobot/{path}"
    for path in (
        "meta/info.json", "meta/stats.json", "meta/tasks.parquet", f"meta/episodes/{_DATA[5:].format(**_FIRST)}",
        _DATA.format(**_FIRST),
    )
)  # fmt: skip
_QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)


def render(source: PlannedMotion) -> dict[str, bytes]:
    """The five files. Raises MissingDependencyError without pyarrow."""
    try:
        import pyarrow as pa
    except ImportError as e:
        raise MissingDependencyError(
            f"a LeRobot dataset needs pyarrow, which can't be imported ({e})",
            to_install("pyarrow", "lerobot"),
        ) from None
    columns, names = frames(source)
    task = f"{source.verb} {source.part.name}"
    stats = {key: statistics(values) for key, values in columns.items()}
    data = pa.table({key: _column(pa, values) for key, values in columns.items()})
    contents = (
        _json(_info(source, columns, names)),
        _json({key: {k: v.tolist() for k, v in s.items()} for key, s in stats.items()}),
        _parquet(_tasks(pa, task)),
        _parquet(_episodes(pa, len(data), task, stats)),
        _parquet(data),
    )
    return dict(zip(FILES, contents, strict=True))


def frames(source: PlannedMotion) -> tuple[dict[str, NDArray[Any]], dict[str, list[str] | None]]:
    """Columns (n,) or (n, d) at `FPS`, and the names of their d numbers.

    observation.state: planned joints (rad, slides m) and gripper (m); action: those of the next frame, which
    are commanded now. observation.tool_pose: in the twin's world, m and quaternion wxyz. phase: index in
    `robots.trajectory.PHASES`.
    """
    t = source.trajectory
    n = int(np.ceil(t.duration * FPS - 1e-9)) + 1
    index = np.arange(n)
    times = t.times[0] + index / FPS
    q, _, gripper = t.at(times)
    state = np.column_stack([q, gripper])
    # the sample that is being executed, as `RobotTrajectory.at` does with the gripper
    before = np.clip(np.searchsorted(t.times, times, side="right") - 1, 0, len(t.times) - 1)
    phases = np.array([PHASES.index(p) for p in t.phases])
    joints = [*(f"{j}_{u}" for j, u in zip(t.joint_names, source.joint_units, strict=True)), "gripper_m"]
    whole = np.zeros(n, dtype=np.int64)
    columns = {
        "observation.state": state.astype(np.float32),
        "observation.tool_pose": _tool(t.times, t.T_world_tool, times).astype(np.float32),
        "observation.part_state": np.interp(times, t.times, t.part_state).astype(np.float32),
        "action": np.concatenate([state[1:], state[-1:]]).astype(np.float32),
        "phase": phases[before].astype(np.int64),
        "timestamp": (index / FPS).astype(np.float32),
        "frame_index": index.astype(np.int64),
        "episode_index": whole,
        "index": index.astype(np.int64),
        "task_index": whole,
    }
    named: dict[str, list[str] | None] = {
        "observation.state": joints,
        "observation.tool_pose": ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"],
        "observation.part_state": [f"part_state_{source.state_unit}"],
        "action": joints,
        "phase": ["phase"],
    }
    return columns, {key: named.get(key) for key in columns}


def statistics(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """What LeRobot normalises with, each (d,) over the frames, and their count (1,); integers stay."""
    table = values.reshape(len(values), -1)
    if not np.issubdtype(table.dtype, np.integer):
        table = table.astype(np.float64)
    found = {"min": table.min(0), "max": table.max(0), "mean": table.mean(0), "std": table.std(0)}
    quantiles = np.quantile(table, _QUANTILES, axis=0)
    named = {f"q{round(100 * p):02d}": q for p, q in zip(_QUANTILES, quantiles, strict=True)}
    return {**found, "count": np.array([len(table)]), **named}


def _tool(times: Array, poses: Array, at: Array) -> Array:
    """Position and quaternion wxyz (m, 7) at times `at` (m,): linear and by the shortest turn."""
    at = np.clip(at, times[0], times[-1])
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    u = ((at - times[k]) / (times[k + 1] - times[k]))[:, None]
    r = poses[:, :3, :3]
    turn = geo.log_so3(np.swapaxes(r[k], -1, -2) @ r[k + 1])
    positions = (1 - u) * poses[k, :3, 3] + u * poses[k + 1, :3, 3]
    return np.column_stack([positions, smooth_quaternions_wxyz(r[k] @ geo.exp_so3(u * turn))])


def _info(
    source: PlannedMotion, columns: dict[str, NDArray[Any]], names: dict[str, list[str] | None]
) -> dict[str, Any]:
    features = {
        key: {"dtype": str(v.dtype), "shape": [v.shape[1] if v.ndim > 1 else 1], "names": names[key]}
        for key, v in columns.items()
    }
    return {
        "codebase_version": "v3.0",
        "robot_type": source.trajectory.robot,
        "total_episodes": 1,
        "total_frames": len(columns["index"]),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": FPS,
        "splits": {"train": "0:1"},
        "data_path": _DATA,
        "video_path": None,
        "features": features,
    }


def _tasks(pa: Any, task: str) -> pa.Table:
    """Tasks with their text as the pandas index, which LeRobot looks them up by."""
    column = {"metadata": None}
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", **column},
            {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", **column},
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": None,
    }  # fmt: skip
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task], pa.string())})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _episodes(pa: Any, length: int, task: str, stats: dict[str, dict[str, NDArray[Any]]]) -> pa.Table:
    row: dict[str, Any] = {
        "episode_index": 0,
        "tasks": [task],
        "length": length,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": 0,
        "dataset_to_index": length,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    for key, found in stats.items():
        row |= {f"stats/{key}/{name}": values.tolist() for name, values in found.items()}
    return pa.table({key: pa.array([value]) for key, value in row.items()})


def _column(pa: Any, values: NDArray[Any]) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])


def _parquet(table: pa.Table) -> bytes:
    import pyarrow.parquet as pq

    out = io.BytesIO()
    pq.write_table(table, out, compression="snappy", use_dictionary=True)
    return out.getvalue()


def _json(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, indent=4, ensure_ascii=False, allow_nan=False) + "\n").encode()
