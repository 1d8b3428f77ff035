"""Environments of other programs: named when they are missing, made only when asked, half-made ones don't
count."""

from __future__ import annotations

from pathlib import Path

import pytest

from twin import engines
from twin.cli.main import run
from twin.errors import InputError, MissingDependencyError


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FUNTWIN_ENGINES", str(tmp_path / "engines"))
    return tmp_path / "engines"


def test_a_missing_environment_is_named_with_the_command_that_makes_it(empty_cache: Path) -> None:
    with pytest.raises(
        MissingDependencyError, match=r"'drake' is not in .*; run `twin engines --install drake`"
    ):
        engines.interpreter("drake")
    with pytest.raises(InputError, match="did you mean 'drake'"):
        engines.engine("drakes")
    assert not empty_cache.exists(), "asking writes nothing"


def test_an_interrupted_installation_does_not_count(empty_cache: Path) -> None:
    folder = engines.engine("pybullet").folder
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python").touch()
    with pytest.raises(MissingDependencyError, match="pybullet"):
        engines.interpreter("pybullet")
    (folder / ".complete").touch()
    assert engines.interpreter("pybullet") == folder / "bin" / "python"


def test_another_set_of_packages_gets_another_folder(empty_cache: Path, tmp_path: Path) -> None:
    folders = {e.folder for e in engines.ENGINES.values()}
    assert len(folders) == len(engines.ENGINES)
    for e in engines.ENGINES.values():
        lines = e.requirements.read_text(encoding="utf-8").split()
        assert lines, e.name
        assert all("==" in line and "://" not in line for line in lines), "pinned, and from no address"


def test_a_folder_that_cannot_be_written_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("FUNTWIN_ENGINES", str(tmp_path / "file" / "engines"))
    assert run(["engines", "--install", "drake"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "FUNTWIN_ENGINES" in error


def test_the_verb_lists_every_environment(empty_cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["engines"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in engines.ENGINES)
    assert "twin engines --install drake newton" in out
