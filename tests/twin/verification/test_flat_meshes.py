"""Flat meshes load everywhere, and what an engine refuses counts."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin import geometry as geo
from twin.cli import main as cli
from twin.exporters import export
from twin.exporters.visual import SHEET, drawn
from twin.geometry import Array
from twin.scene import Mesh, Twin
from twin.storage import save
from twin.verification import check, check_many, tables
from twin.verification.behaviour import behave
from twin.verification.behaviour_tables import summary

SQUARE = np.array([[0, 0, 0], [0.4, 0, 0], [0.4, 0, 0.3], [0, 0, 0.3]], float)
TWO = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
ASLANT = geo.make_pose(geo.exp_so3([0.2, 0.4, 0.5]), [0.9, 0.35, 0.5])
LEVEL = geo.make_pose(translation=[0.9, 0.35, 0.5])
CROSS = np.concatenate([SQUARE - [0.2, 0, 0.15], (SQUARE - [0.2, 0, 0.15])[:, [1, 0, 2]]])
FLAT = {
    "one triangle": Mesh(SQUARE[:3], TWO[:1]),
    "a sheet": Mesh(SQUARE, TWO, np.full((4, 3), 120, np.uint8)),
    "seen from both sides": Mesh(SQUARE, np.concatenate([TWO, TWO[:, ::-1]])),
    "bent by less than a reader sees": Mesh(SQUARE + [[0, 1e-8, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]], TWO),
    "two sheets that cross": Mesh(CROSS, np.concatenate([TWO, TWO + 4])),
    "a needle": Mesh(SQUARE[:3] * [1, 1, 1e-6], TWO[:1]),
    "without area": Mesh(SQUARE[[0, 1, 1]], TWO[:1]),
}


def with_static(mesh: Mesh) -> Twin:
    twin = cabinet_twin()
    return replace(twin, static=replace(twin.static, mesh=mesh))


def with_door(mesh: Mesh) -> Twin:
    twin = cabinet_twin()
    return replace(twin, parts=(replace(twin.parts[0], mesh=mesh), *twin.parts[1:]))


@pytest.mark.parametrize("pose", [LEVEL, ASLANT], ids=["level", "aslant"])
def test_a_flat_visual_mesh_loads_in_every_format_and_engine(pose: Array, tmp_path: Path) -> None:
    twins = [with_static(m.transformed(pose)) for m in FLAT.values()]
    twins += [with_door(FLAT[n].transformed(pose)) for n in ("one triangle", "a sheet")]
    sources = [(t, export(t, tmp_path / str(k))) for k, t in enumerate(twins)]
    for report in check_many(sources):
        assert (report.warnings, report.failures) == ((), ())


def test_a_flat_mesh_gets_a_back_and_nothing_else_changes() -> None:
    mesh = FLAT["a sheet"].transformed(ASLANT)
    got = drawn(mesh)
    assert np.array_equal(got.vertices[:4], mesh.vertices)
    assert np.array_equal(got.faces[:2], mesh.faces)
    assert got.area == pytest.approx(2 * mesh.area)
    away = np.linalg.norm(got.vertices[4:] - mesh.vertices[mesh.faces].reshape(-1, 3), axis=1)
    assert away == pytest.approx(np.full(6, SHEET))
    solid = cabinet_twin().parts[0].mesh
    kept = drawn(solid)
    assert np.array_equal(kept.vertices, solid.vertices)
    assert np.array_equal(kept.faces, solid.faces)
    assert kept.colors is not None
    assert solid.colors is not None
    assert np.array_equal(kept.colors, solid.colors)


def test_a_file_that_cant_be_loaded_counts_in_the_headline_and_the_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = cabinet_twin()
    files = export(twin, tmp_path / "export")
    mesh = tmp_path / "export" / "urdf" / "meshes" / "door_visual.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    report = check(twin, files)
    told = tables.summary(report)
    assert told.endswith("can't be loaded: urdf in mujoco")
    agree, of = map(int, re.findall(r"(\d+) of (\d+)", told)[0])
    assert agree < of
    assert "can't be simulated: urdf" in summary(behave(twin, files))
    save(twin, tmp_path / "twin")
    assert cli.run(["check", str(tmp_path), "--format", "urdf"]) == 2
    assert "can't be loaded: urdf in mujoco" in capsys.readouterr().out
