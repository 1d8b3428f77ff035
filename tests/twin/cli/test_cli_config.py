"""`twin config`: every setting with what it means and what gives it, here and of a run; names of earlier
versions are told once."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from benchmarks.scenes.boards import cabinet_twin
from recon.config import ReconConfig
from twin.cli import main as cli
from twin.cli.table import SETTINGS
from twin.runs.settings import as_dict, from_dict, to_toml
from twin.storage import save


def told(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    """What `twin config WORDS --json` prints."""
    assert cli.run(["config", *words, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def by_name(data: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {s["name"]: s for s in data["settings"]}


@pytest.mark.parametrize("what", SETTINGS)
def test_every_setting_is_listed_with_what_it_means(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    data = told(capsys, "--of", what)
    assert data["of"] == what
    assert data["changed"] == []
    assert {s["source"] for s in data["settings"]} == {"default"}
    assert all(s["meaning"] for s in data["settings"])
    assert cli.run(["config", "--of", what]) == 0
    shown = capsys.readouterr().out
    assert f"0 of {len(data['settings'])} settings differ from today's defaults" in shown


def test_what_gives_a_setting_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "my.toml"
    file.write_text("[labels]\nevery = 2\n[motion]\nmax_parts = 9\n[fusion]\npart_voxel = 0.005\n")
    data = told(capsys, "--config", str(file), "--set", "motion.max_parts=5")
    rows = by_name(data)
    assert [rows[n]["source"] for n in ("labels.every", "fusion.part_voxel", "fusion.static_voxel")] == [
        str(file),
        str(file),
        "default",
    ]
    assert (rows["motion.max_parts"]["source"], rows["motion.max_parts"]["value"]) == ("--set", 5)
    assert rows["labels.every"]["unit"] == "frames"
    assert data["changed"] == ["motion.max_parts", "labels.every"]
    few = told(capsys, "--set", "motion.max_parts=5", "--changed")
    assert list(by_name(few)) == ["motion.max_parts"]
    assert cli.run(["config", "--set", "motion.max_parts=5", "--changed"]) == 0
    assert "(default 8 parts)" in capsys.readouterr().out


def test_a_run_tells_what_it_was_made_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made_with = from_dict(ReconConfig, {"tracks": {"max_depth": float("inf")}, "labels": {"every": 3}})
    (tmp_path / "config.toml").write_text(to_toml(made_with))
    data = told(capsys, str(tmp_path))
    assert data["changed"] == ["tracks.max_depth", "labels.every"]
    assert by_name(data)["labels.every"]["source"] == str(tmp_path)
    assert by_name(data)["labels.every"]["default"] == 4
    (tmp_path / "config.toml").unlink()
    twin = cabinet_twin()
    twin.provenance["config"] = as_dict(made_with)
    save(twin, tmp_path / "twin")
    assert told(capsys, str(tmp_path / "twin"))["settings"][1]["value"] == "inf"
    assert told(capsys, str(tmp_path))["changed"] == ["tracks.max_depth", "labels.every"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["nowhere"], "nowhere does not exist"),
        (["."], ". tells no settings"),
        ([".", "--set", "labels.every=2"], ". has its own settings"),
        ([".", "--config", "other.toml"], ". has its own settings"),
        (
            ["--set", "motion.max_parts=0"],
            "--set: motion.max_parts = 0 must be at least 1 part; the default is 8",
        ),
        (["--set", "labels.evry=2"], "--set: unknown key 'labels.evry'; did you mean 'labels.every'?"),
        (["--of", "lint"], "invalid choice: 'lint'"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    words: list[str],
    line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["config", *words]) == 1
    err = capsys.readouterr().err
    assert line in err
    assert err.count("\n") == 1


def test_the_toml_repeats_the_settings(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["config", "--toml", "--set", "labels.every=2"]) == 0
    text = capsys.readouterr().out
    assert from_dict(ReconConfig, tomllib.loads(text)) == from_dict(ReconConfig, {"labels": {"every": 2}})
    assert "# every so many frames one is labelled [at least 1; default 4 frames]\nevery = 2\n" in text
