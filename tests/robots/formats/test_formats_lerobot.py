"""The LeRobot dataset: its documented layout, its numbers, and LeRobot itself where it is installed."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from robots.formats import export_trajectory
from robots.trajectory import PHASES
from tests.makers.robots import planned_motions
from tests.makers.robots.planned_motions import contents, stacked
from twin import geometry as geo
from twin.errors import MissingDependencyError


@pytest.fixture(scope="module")
def source():
    return planned_motions.door()


@pytest.fixture(scope="module")
def dataset(source, tmp_path_factory):
    pytest.importorskip("pyarrow")
    out = tmp_path_factory.mktemp("dataset")
    export_trajectory(source, ["lerobot"], out)
    return out / "lerobot"


def test_lerobot_has_the_layout_of_v3(source, dataset):
    pq = pytest.importorskip("pyarrow.parquet")
    info = json.loads((dataset / "meta/info.json").read_text(encoding="utf-8"))
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["splits"], info["robot_type"]) == (1, {"train": "0:1"}, "franka")
    data = pq.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    assert data.num_rows == info["total_frames"] == int(np.ceil(source.trajectory.duration * info["fps"])) + 1
    assert set(data.column_names) == set(info["features"])
    for key, feature in info["features"].items():
        kind, size = data.schema.field(key).type, feature["shape"][0]
        expected = feature["dtype"].replace("float32", "float")
        assert str(kind) == (expected if size == 1 else f"fixed_size_list<element: {expected}>[{size}]")
        assert feature["names"] is None or len(feature["names"]) == size
    tasks = pq.read_table(dataset / "meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0], "task": ["open door"]}
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    (episode,) = pq.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, data.num_rows)
    assert (episode["length"], episode["tasks"]) == (data.num_rows, ["open door"])
    stats = json.loads((dataset / "meta/stats.json").read_text(encoding="utf-8"))
    assert set(stats) == set(info["features"])
    assert episode["stats/action/max"] == stats["action"]["max"]


def test_lerobot_holds_the_motion(source, dataset):
    pq = pytest.importorskip("pyarrow.parquet")
    t = source.trajectory
    data = pq.read_table(dataset / "data/chunk-000/file-000.parquet").to_pydict()
    stamps, state, action = (np.array(data[k]) for k in ("timestamp", "observation.state", "action"))
    assert np.abs(stamps - np.arange(len(stamps)) / 30).max() < 1e-5
    assert np.abs(np.diff(stamps) - 1 / 30).max() < 1e-4  # LeRobot's own tolerance
    assert np.array_equal(action[:-1], state[1:])
    assert np.all((state[:, :-1] >= t.limits[0] - 1e-6) & (state[:, :-1] <= t.limits[1] + 1e-6))
    for k, joint in enumerate(t.joint_names):
        linear = np.interp(stamps, t.times, t.q[:, k])
        assert np.abs(state[:, k] - linear).max() < 1e-3, joint
    assert np.allclose(state[[0, -1], :-1], t.q[[0, -1]], atol=1e-6)
    assert [PHASES[p] for p in dict.fromkeys(data["phase"])] == list(PHASES)
    tool = np.array(data["observation.tool_pose"])
    joint, moving = source.part.joint, np.array(data["phase"]) == PHASES.index("move")
    start = t.T_world_tool[t.phases.index("close")]
    wanted = joint.poses(np.array(data["observation.part_state"])[moving]) @ start
    found = stacked(geo.matrix_from_quat_wxyz(tool[moving, 3:]), tool[moving, :3])
    assert np.abs(found - wanted).max() < 5e-4


def test_lerobot_itself_reads_the_dataset(dataset, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    module = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    loaded = module.LeRobotDataset("local/door", root=dataset)
    assert loaded[0]["task"] == "open door"
    assert len(loaded) == loaded.meta.total_frames


def test_without_pyarrow_the_extra_is_named_and_nothing_written(source, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingDependencyError, match=r"install the package pyarrow.*extra `lerobot`"):
        export_trajectory(source, ["csv", "lerobot"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_equal_input_gives_equal_bytes(source, dataset, tmp_path):
    export_trajectory(source, ["lerobot"], tmp_path)
    assert contents(tmp_path / "lerobot") == contents(dataset)
