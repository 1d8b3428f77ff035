"""Wrong input to `twin export` ends with one line that names it, exit code 1 and no file."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.cli.main import run
from twin.errors import InputError
from twin.exporters import export
from twin.exporters.asset import AssetInfo
from twin.exporters.usd.layers import new_layer
from twin.files.ply import ply_bytes
from twin.scene import Mesh
from twin.storage import save


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "twin")
    return tmp_path


def refused(folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    """The one line of a refused export, which left nothing behind."""
    before = sorted(p for p in folder.rglob("*") if "report" not in p.name)
    assert run(["export", str(folder), "--format", "mjcf", *options]) == 1
    (said,) = (x for x in capsys.readouterr().err.splitlines() if x)
    assert said.startswith("twin: ")
    assert sorted(p for p in folder.rglob("*") if "report" not in p.name) == before
    return said


def edit(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    path = folder / "twin" / "twin.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def at(document: dict[str, Any], path: str, value: Any) -> None:
    *keys, last = path.split(".")
    node: Any = document
    for key in keys:
        node = node[int(key) if key.isdecimal() else key]
    node[last] = value


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("name", "kitchen/../door", ("name", "kitchen/../door")),
        ("name", "world", ("world",)),
        ("parts.0.name", "dør 1", ("dør 1",)),
        ("parts.0.name", "drawer", ("drawer",)),
        ("parts.0.name", "CARCASS", ("CARCASS",)),
        ("parts.0.inertial.mass", float("nan"), ("parts[0].inertial", "nan")),
        ("parts.0.inertial.mass", 0.0, ("parts[0].inertial", "0.0")),
        ("parts.0.inertial.mass", -2.5, ("parts[0].inertial", "-2.5")),
        ("parts.0.inertial.inertia", [1.0, 1.0, 5.0, 0.0, 0.0, 0.0], ("triangle",)),
        ("parts.0.inertial.com", [0.0, float("inf"), 0.0], ("centre of mass", "finite")),
        ("parts.0.joint.lower", 2.0, ("limits", "2.0..1.4")),
        ("parts.0.joint.upper", 0.0, ("'door'", "empty range 0.0..0.0")),
        ("parts.0.joint.upper", "1.4", ("upper", "'1.4'")),
        ("parts.0.joint.axis", [0.0, 0.0, 0.0], ("axis", "length")),
        ("parts.0.joint.type", "ball", ("ball",)),
        ("parts.0.parent", 3, ("'door'", "ancestor")),
        ("parts.0.parent", 2, ("'door'", "ancestor")),
        ("parts.0.mesh", "../../etc/passwd", ("mesh", "../../etc/passwd")),
        ("parts.0.mesh", "meshes/none.ply", ("none.ply",)),
        ("parts.0.physics.friction.value", -1.0, ("friction", "-1.0")),
    ],
)
def test_values_that_can_not_be_are_named(
    saved: Path, capsys: pytest.CaptureFixture[str], path: str, value: Any, words: tuple[str, ...]
) -> None:
    def change(document: dict[str, Any]) -> None:
        if path == "parts.0.parent" and value == 3:  # each of the two parts hangs on the other
            at(document, "parts.1.parent", 2)
        at(document, path, value)

    edit(saved, change)
    said = refused(saved, capsys)
    for word in words:
        assert word in said, said


def test_meshes_that_can_not_be_read_or_are_empty_are_named(
    saved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = next((saved / "twin" / "meshes").glob("door.ply"))
    mesh.write_bytes(b"solid\n")
    assert "door.ply" in refused(saved, capsys)
    mesh.write_bytes(ply_bytes(Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))))
    assert "'door'" in refused(saved, capsys)


def test_options_that_can_not_be_are_named(saved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("Kitchen", "a", "2doors", "my__door", "door-left", "../door"):
        assert repr(name) in refused(saved, capsys, "--package", name)
    assert "did you mean 'author'" in refused(saved, capsys, "--asset", "autor=Me")
    assert "KEY=VALUE" in refused(saved, capsys, "--asset", "author")
    assert "'20260131'" in refused(saved, capsys, "--asset", "date=20260131")
    assert "'14745'" in refused(saved, capsys, "--asset", "qcode=14745")
    assert "author" in refused(saved, capsys, "--asset", "author= ")


def test_a_date_comes_from_the_build_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    assert AssetInfo().date == "1970-01-01"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1769817600")
    assert AssetInfo().date == "2026-01-31"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(InputError, match="'yesterday'"):
        AssetInfo()


def test_a_disk_that_fills_up_leaves_the_earlier_export_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin = cabinet_twin()
    export(twin, tmp_path, formats=("mjcf", "usd"))
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("twin.exporters.usd.write_stage", full)  # the last step of the last format
    heavier = replace(twin, parts=twin.parts[:1])
    with pytest.raises(InputError, match="No space left"):
        export(heavier, tmp_path, formats=("mjcf", "usd"))
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_a_layer_that_can_not_be_written_fails_like_any_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"file/layer\.usda"):
        new_layer(tmp_path / "file" / "layer.usda", "a", "").__enter__()


def test_a_part_without_collision_shapes_is_warned_about(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin = cabinet_twin()
    bare = replace(twin.parts[0], collision=())
    monkeypatch.setattr("twin.exporters.complete", lambda t, *_: t)
    said = export(replace(twin, parts=(bare, *twin.parts[1:])), tmp_path, formats=("mjcf",)).warnings
    assert said == ("all: door has no collision shapes, so nothing can touch it",)
    assert export(twin, tmp_path, formats=("mjcf",)).warnings == ()
