"""Bars: on a terminal by default, after two seconds, one at a time, and nowhere else."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from recon.pipeline import _SECONDS
from tests.test_layout import stages_of_the_pipeline
from twin.cli.console import Console
from twin.runs import progress
from twin.runs.progress import Bars, Counted, default_progress, shows_bar
from twin.runs.stages import Run


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Standard error is a terminal; to be called in the test itself, whose own capture comes after its
    fixtures."""
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


def test_progress_on_request_shows_lines_where_there_is_no_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with default_progress(True) as told:
        told("piped", 0.5)
        told("piped", 1.0, "3.0 s")
    assert capsys.readouterr() == ("", "piped        3.0 s\n")


def test_progress_on_request_shows_a_bar_at_once_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    with default_progress(True) as told:
        told("asked", 1.0)
    assert "asked" in terminal.getvalue()


def test_no_progress_on_request_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with default_progress(False) as told:
        told("hidden", 0.5)
    assert terminal.getvalue() == ""


def test_stages_are_counted_and_the_time_left_is_told() -> None:
    """What came from the cache took no time, so it says nothing about how long the rest takes."""
    heard: list[str] = []
    clock = [0.0]
    weights = {"first": 100.0, "second": 10.0, "third": 30.0}

    def listen(stage: str, fraction: float, message: str = "") -> None:
        heard.append(f"{stage} {fraction}: {message}")

    counted = Counted(listen, weights, lambda: clock[0])
    counted("first", 1.0, "from the cache")
    counted("second", 0.0)
    clock[0] = 20.0
    counted("second", 1.0, "20.0 s")
    clock[0] = 200.0
    counted("third", 0.5, "rows")
    counted("third", 1.0)
    counted("export", 0.2, "else")
    assert heard == [
        "first 1.0: from the cache, 1 of 3",
        "second 0.0: 2 of 3",
        "second 1.0: 20.0 s, 2 of 3, about 60 s left",
        "third 0.5: rows, 3 of 3, about 2 min left",
        "third 1.0: 3 of 3",
        "export 0.2: else",
    ]


def test_the_pipeline_knows_how_long_each_of_its_stages_takes() -> None:
    assert list(_SECONDS) == stages_of_the_pipeline()


def test_bars_that_are_stopped_early_do_not_start_later(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    with Bars(0.05) as bars:
        bars("short", 0.5)
    time.sleep(0.15)
    assert "short" not in terminal.getvalue()
