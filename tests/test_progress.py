"""Bars: on a terminal by default, after two seconds, one at a time, and nowhere else."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from twin.cli.console import Console
from twin.runs import progress
from twin.runs.progress import Bars, default_progress, shows_bar
from twin.runs.stages import Run


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Standard error is a terminal; to be called in the test itself, whose own capture comes after its fixtures."""
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    return shown


def test_a_call_from_python_shows_a_bar_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "PATIENCE", 0.01)
    twin.export(cabinet_twin(), tmp_path, ["urdf"])
    assert "export" in terminal.getvalue()


def test_nothing_is_shown_before_the_patience_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    with default_progress() as told:
        told("quick", 0.5)
    assert "quick" not in terminal.getvalue()


def test_nothing_is_shown_where_there_is_no_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with default_progress() as told:
        told("piped", 0.5)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("quiet", [True, False])
def test_work_inside_a_verb_draws_no_second_bar(quiet: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)

    @shows_bar("inner")
    def work() -> int:
        return 3

    with Console(quiet=quiet).progress() as told:
        told("outer", 1.0)
        assert work() == 3
    assert "inner" not in terminal.getvalue()
    assert ("outer" in terminal.getvalue()) == (not quiet)
    assert work() == 3  # by itself it draws one
    assert "inner" in terminal.getvalue()


def test_the_callers_own_progress_is_told_and_no_bar_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    heard: list[str] = []

    def mine(stage: str, fraction: float, message: str = "") -> None:
        heard.append(stage)

    with default_progress(mine) as told, Run(None, "x", told) as run:
        run.stage("work", 1, None, [], lambda: 1)
    assert heard == ["work", "work"]
    assert terminal.getvalue() == ""


def test_bars_that_are_stopped_early_do_not_start_later(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    with Bars(0.05) as bars:
        bars("short", 0.5)
    time.sleep(0.15)
    assert "short" not in terminal.getvalue()
