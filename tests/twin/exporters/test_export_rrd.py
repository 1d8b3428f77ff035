"""Rerun files, read back by Rerun's own reader: parts stand where joints put them at each time, film and
labels at theirs, tracks in the camera that saw them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.twin.page.test_page import seen
from twin import report
from twin.cli.main import run as cli
from twin.completion.asset import AssetView
from twin.errors import MissingDependencyError
from twin.exporters import Exported, Footage, export
from twin.geometry import Array, transform
from twin.scene import Twin
from twin.storage import save

chunk = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")
TRACKS = {0: np.array([[0.1, 0.2, 1.5]]), 5: np.array([[0.0, 0.0, 2.0], [0.3, 0.1, 1.0]])}
AS_RECORDED = AssetView("complete", "keep", "camera")


@pytest.fixture(scope="module")
def cabinet() -> Twin:
    return seen(cabinet_twin())


@pytest.fixture(scope="module")
def files(cabinet: Twin, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    run = tmp_path_factory.mktemp("run")
    size = next(iter(cabinet.labels.values())).shape
    report.save_film(run, report.film_frames(cabinet), lambda f: np.full((*size, 3), f % 250, np.uint8))
    report.save_key_frames(run, {}, np.array([[50.0, 0, 32], [0, 50.0, 24], [0, 0, 1]]))
    return export(cabinet, run / "export", "rrd", view=AS_RECORDED, footage=Footage(run, TRACKS))


@pytest.fixture(scope="module")
def columns(files: Exported) -> dict[str, dict[str, list[Any]]]:
    """Values of each column by entity, in the order of the file."""
    out: dict[str, dict[str, list[Any]]] = {}
    for piece in chunk.RrdReader(files["rrd"]).stream().to_chunks():
        batch = piece.to_record_batch()
        entity = out.setdefault(str(piece.entity_path).strip("/"), {})
        for name in batch.schema.names:
            values = batch.column(name)
            entity.setdefault(name, []).extend(
                (values.cast("int64") if name == "time" else values).to_pylist()
            )
    return out


def column(entity: dict[str, list[Any]], word: str) -> Array:
    """The one column whose name ends so, rows of one value."""
    (name,) = [n for n in entity if n.endswith(word)]
    return np.array([np.asarray(v, object)[0] for v in entity[name]], object)


def seconds(entity: dict[str, list[Any]]) -> Array:
    return np.array(entity["time"]) / 1e9


def test_parts_stand_where_their_joints_put_them(
    cabinet: Twin, columns: dict[str, dict[str, list[Any]]]
) -> None:
    for part in cabinet.parts:
        (name,) = [n for n in columns if n.endswith(f"/{part.name}") and n.startswith("world/")]
        moved = columns[name]
        place = np.array([list(v) for v in column(moved, ":translation")], float)
        turn = np.array([list(v) for v in column(moved, ":quaternion")], float)
        times = seconds(moved)
        assert np.allclose(times, part.motion.times - cabinet.cameras.times[0], atol=1e-6)  # type: ignore[union-attr]
        mesh = columns[f"{name}/{part.name}_visual"]
        corners = np.array(
            [list(v) for v in np.asarray(mesh[next(n for n in mesh if n.endswith(":vertex_positions"))][0])]
        )
        for k in (0, len(times) // 2, len(times) - 1):
            x, y, z, w = turn[k]
            R = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
            want = transform(part.joint.pose(part.motion.state[k]), part.mesh.vertices)
            got = corners @ R.T + place[k]
            assert np.allclose(got.min(axis=0), want.min(axis=0), atol=1e-4)
            assert np.allclose(got.max(axis=0), want.max(axis=0), atol=1e-4)


def test_film_labels_and_tracks_stand_at_their_times(
    cabinet: Twin, columns: dict[str, dict[str, list[Any]]]
) -> None:
    assert cabinet.cameras is not None
    at = dict(
        zip(cabinet.cameras.frames.tolist(), cabinet.cameras.times - cabinet.cameras.times[0], strict=True)
    )
    film = columns["world/camera/image"]
    frames = [f for f in film["frame"] if f is not None]
    assert sorted(frames) == report.film_frames(cabinet)
    for entity, wanted in (
        ("world/camera/image/labels", sorted(set(cabinet.labels) & set(at))),
        ("world/camera/tracks", sorted(set(TRACKS) & set(at))),
    ):
        found = columns[entity]
        told = {f: t / 1e9 for f, t in zip(found["frame"], found["time"], strict=True) if f is not None}
        assert sorted(told) == wanted
        assert all(told[f] == pytest.approx(at[f], abs=1e-6) for f in told)
    ways = np.array([list(v) for v in column(columns["world/camera"], ":translation")], float)
    assert np.allclose(ways, cabinet.cameras.T_world_cam[:, :3, 3], atol=1e-5)


def test_a_twin_alone_needs_no_run(cabinet: Twin, tmp_path: Path) -> None:
    found = export(cabinet, tmp_path, "rrd")
    assert found["rrd"].stat().st_size > 1000
    assert any("keeps no film" in w for w in found.warnings)
    assert "rerun cabinet.rrd" in (tmp_path / "rrd" / "README.md").read_text()


def test_the_command_line_writes_it_where_it_is_named(cabinet: Twin, tmp_path: Path) -> None:
    save(cabinet, tmp_path / "run" / "twin")
    assert cli(["export", str(tmp_path / "run"), "--format", "rrd"]) == 0
    assert [p.name for p in (tmp_path / "run" / "export").iterdir()] == ["rrd"]


def test_without_the_package_one_line_names_the_extra(
    cabinet: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingDependencyError, match="extra `rerun`"):
        export(cabinet, tmp_path / "out", "rrd")
    assert not (tmp_path / "out" / "rrd").exists()
