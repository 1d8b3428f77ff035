"""A batch with a stand-in for the program: whatever fails, no finished unit is lost or done twice."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.makers.browser import browser
from twin.batch import Batch, Settings, claims, units_of, work
from twin.batch.batch import State
from twin.batch.claims import Claims
from twin.batch.journal import JOURNAL, append, latest
from twin.batch.page import write_page
from twin.batch.table import write_table
from twin.cli.main import run as twin_verb
from twin.files.text import read_json

STAND_IN = Path(__file__).parent / "stand_in.py"
ROOT = Path(__file__).parents[3]
QUICK = Settings(workers=2, timeout=30.0)


@pytest.fixture(autouse=True)
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the stand-in tells its calls."""
    path = tmp_path / "calls"
    monkeypatch.setattr(work, "PROGRAM", (sys.executable, str(STAND_IN), str(path)))
    return path


def recordings(tmp_path: Path, *names: str) -> list[str]:
    for name in names:
        (tmp_path / "recordings" / name).mkdir(parents=True)
        (tmp_path / "recordings" / name / "color.txt").write_text(name)
    return [str(tmp_path / "recordings" / "*")]


def called(calls: Path, verb: str) -> list[str]:
    return [line.split()[1] for line in calls.read_text().splitlines() if line.split()[0] == verb]


def go(given: list[str], out: Path, settings: Settings = QUICK) -> State:
    return Batch(units_of(given), out, settings).go(_heard)


def _heard(_: State) -> None:
    pass


def test_whatever_fails_the_others_go_on(tmp_path: Path, calls: Path) -> None:
    given = recordings(tmp_path, "a", "poisoned", "hangs", "eats", "crashes", "doubtful", "z")
    state = go(given, tmp_path / "out", Settings(workers=3, timeout=6.0, memory_mb=300.0))
    ends = {k.rpartition("_")[0]: r for k, r in state.rows.items()}
    assert {k: r["exit"] for k, r in ends.items()} == {
        "a": 0, "z": 0, "doubtful": 2, "poisoned": 1, "hangs": 1, "eats": 1, "crashes": 1,
    }  # fmt: skip
    assert ends["poisoned"]["error"] == "reconstruct: depth/000007.png is cut off; copy it again"
    assert ends["hangs"]["error"] == "reconstruct was ended after 6 s"
    assert ends["eats"]["error"] == "too large for this machine: reconstruct took more than 300 MB"
    assert "signal 6" in ends["crashes"]["error"]
    assert ends["doubtful"]["reasons"] == ["AxisUnsure"]
    assert 300 < ends["eats"]["peak_mb"] < 1500
    assert not list((tmp_path / "out" / "claims").iterdir())
    before = calls.read_text()
    assert go(given, tmp_path / "out").rows.keys() == state.rows.keys()
    assert calls.read_text() == before  # all is done, the failed ones too
    go(given, tmp_path / "out", Settings(workers=3, timeout=6.0, memory_mb=300.0, retry="failed"))
    again = called(calls, "reconstruct")[7:]
    assert {n.rpartition("_")[0] for n in again} == {"poisoned", "hangs", "eats", "crashes"}
    go(given, tmp_path / "out", Settings(workers=3, timeout=30.0, retry="doubtful"))
    assert [n.rpartition("_")[0] for n in called(calls, "reconstruct")[11:]] == ["doubtful"]


def test_a_seed_is_rendered_and_evaluated_and_ids_hold_elsewhere(tmp_path: Path, calls: Path) -> None:
    state = go(["random:3-4", *recordings(tmp_path, "a")], tmp_path / "out")
    assert sorted(called(calls, "simulate")) == ["random_000003", "random_000004"]
    assert sorted(called(calls, "evaluate")) == ["random_000003", "random_000004"]
    (tmp_path / "recordings").rename(tmp_path / "moved")
    moved = units_of([str(tmp_path / "moved" / "a"), "random:4"])
    assert {u.id for u in moved} <= state.rows.keys()
    listed = tmp_path / "list.txt"
    listed.write_text("# mine\nmoved/a\n\nrandom:4\n")
    assert [u.id for u in units_of([f"@{listed}"])] == [u.id for u in moved]
    (tmp_path / "moved" / "README.md").write_text("not one")
    (tmp_path / "moved" / "b.r3d").write_bytes(b"zip")
    assert [Path(u.source).name for u in units_of([f"{tmp_path}/moved/*"])] == ["a", "b.r3d"]
    (tmp_path / "moved" / "a" / "color.txt").write_text("other")
    assert units_of([str(tmp_path / "moved" / "a")])[0].id not in state.rows


def test_other_settings_are_other_results(tmp_path: Path, calls: Path) -> None:
    given = recordings(tmp_path, "a")
    go(given, tmp_path / "out")
    go(given, tmp_path / "out", Settings(workers=1, options=("--set=labels.every=3",)))
    assert len(called(calls, "reconstruct")) == 2
    go(given, tmp_path / "out", Settings(workers=2, options=("--set=labels.every=3",)))
    assert len(called(calls, "reconstruct")) == 2


def test_what_is_not_kept_goes(tmp_path: Path) -> None:
    state = go(recordings(tmp_path, "a"), tmp_path / "out", Settings(workers=1, keep="exports"))
    (unit,) = state.rows
    assert not (tmp_path / "out" / "runs" / unit / "stages").exists()
    assert (tmp_path / "out" / "runs" / unit / "twin" / "twin.json").is_file()


DRIVER = """
import sys
from pathlib import Path
from twin import interrupt
from twin.batch import Batch, Settings, claims, units_of, work
interrupt.handle()
work.PROGRAM = (sys.executable, {stand_in!r}, {calls!r})
try:
    Batch(units_of([{given!r}]), Path({out!r}), Settings(workers=2, timeout=60.0)).go(lambda state: None)
except KeyboardInterrupt:
    sys.exit(130)
"""


def driver(given: list[str], out: Path, calls: Path, seconds: float) -> subprocess.Popen[bytes]:
    code = DRIVER.format(stand_in=str(STAND_IN), calls=str(calls), given=given[0], out=str(out))
    environment = {**os.environ, "STAND_IN_SECONDS": str(seconds), "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", code], env=environment)


def gone(calls: Path) -> bool:
    """Whether no process that was called is left."""
    pids = [line.split()[2] for line in calls.read_text().splitlines()]
    return not any(
        Path(f"/proc/{pid}/cmdline").exists() and b"stand_in" in Path(f"/proc/{pid}/cmdline").read_bytes()
        for pid in pids
    )


def until(told: Any, patience: float = 20.0) -> None:
    end = time.monotonic() + patience
    while not told():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_killed_batch_leaves_nothing_at_work_and_goes_on(
    number: signal.Signals, tmp_path: Path, calls: Path
) -> None:
    given = recordings(tmp_path, "a", "b", "c")
    process = driver(given, tmp_path / "out", calls, 30.0)
    until(lambda: calls.exists() and len(called(calls, "reconstruct")) == 2)
    process.send_signal(number)
    process.wait(timeout=20)
    until(lambda: gone(calls))
    assert len(go(given, tmp_path / "out").rows) == 3


def test_two_batches_share_the_work(tmp_path: Path, calls: Path) -> None:
    given = recordings(tmp_path, *"abcdefgh")
    both = [driver(given, tmp_path / "out", calls, 0.3) for _ in range(2)]
    assert [p.wait(timeout=120) for p in both] == [0, 0]
    assert len(called(calls, "reconstruct")) == 8
    assert len(latest(tmp_path / "out")) == 8
    assert len((tmp_path / "out" / JOURNAL).read_text().splitlines()) == 8


def test_twenty_kills_end_in_the_same_twins(tmp_path: Path, calls: Path) -> None:
    given, pauses = recordings(tmp_path, *"abcd"), np.random.default_rng(7).uniform(0.2, 1.4, 20)
    for pause in pauses:
        process = driver(given, tmp_path / "out", calls, 0.5)
        time.sleep(pause)
        before = latest(tmp_path / "out").keys()
        process.kill()
        process.wait()
        assert before <= latest(tmp_path / "out").keys()
    go(given, tmp_path / "out")
    go(given, tmp_path / "whole")
    for unit in latest(tmp_path / "whole"):
        twins = [tmp_path / out / "runs" / unit / "twin" / "twin.json" for out in ("out", "whole")]
        assert twins[0].read_bytes() == twins[1].read_bytes()


def test_a_line_that_was_cut_off_says_nothing_and_spoils_nothing(tmp_path: Path) -> None:
    append(tmp_path, {"id": "a", "exit": 0})
    with (tmp_path / JOURNAL).open("a") as file:
        file.write('{"id": "b", "ex')
    append(tmp_path, {"id": "c", "exit": 1})
    assert {k: r["exit"] for k, r in latest(tmp_path).items()} == {"a": 0, "c": 1}


def test_the_page_and_the_table_tell_all(tmp_path: Path) -> None:
    given = ["random:3", *recordings(tmp_path, "a", "poisoned", "doubtful")]
    state = go(given, tmp_path / "out")
    text = write_page(tmp_path / "out", state).read_text()
    assert text.count('<article class="card') == 4
    assert "depth/000007.png is cut off" in text
    assert "&lt;b&gt;door: hinge, 86°" in text  # names are text
    assert "<b>door" not in text
    lines = list(csv.DictReader(write_table(tmp_path / "out", state.rows).open()))
    assert [line["part"] for line in lines] == ["<b>door"] * 3
    (measured,) = [line for line in lines if line["id"] == "random_000003"]
    assert (measured["true_part"], measured["axis_error_deg"]) == ("true door", "0.5")


def test_by_the_command_line(tmp_path: Path, calls: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given, out = recordings(tmp_path, "a", "b", "poisoned"), str(tmp_path / "out")
    assert twin_verb(["batch", *given, "-o", out, "--dry-run", "--json"]) == 0
    assert [u["done"] for u in json.loads(capsys.readouterr().out)["units"]] == [False] * 3
    assert not calls.exists()
    assert twin_verb(["batch", *given, "-o", out, "--shard", "0/2", "--do", "reconstruct", "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert [u["id"].rpartition("_")[0] for u in told["units"]] == ["a", "poisoned"]
    assert twin_verb(["batch", "-o", out, "--page"]) == 2
    assert "1 of 2 failed" in capsys.readouterr().err
    assert (tmp_path / "out" / "index.html").is_file()
    for wrong, why in (
        (["--shard", "2/2"], "i from 0 to n - 1"),
        (["--do", "export"], "reconstruct must be among them"),
        (["--set", "labels.evry=2"], "labels.every"),
    ):
        assert twin_verb(["batch", *given, "-o", out, *wrong]) == 1
        assert why in capsys.readouterr().err
    assert twin_verb(["batch", str(tmp_path / "nothing"), "-o", out]) == 1


def test_the_page_is_filtered_in_a_browser(tmp_path: Path) -> None:
    state = go(recordings(tmp_path, "a", "poisoned", "doubtful"), tmp_path / "out")
    page = write_page(tmp_path / "out", state)
    with browser(tmp_path / "profile") as tab:
        tab.size(390, 844)
        tab.open(page.as_uri())
        shown = "document.getElementById('shown').textContent"
        assert tab.run(shown) == "3"
        assert tab.run("document.documentElement.scrollWidth") <= 390
        tab.run("document.querySelector('[data-level=failed]').click()")
        assert tab.run(shown) == "1"
        tab.run("document.querySelector('[data-level=failed]').click()")
        tab.run("document.querySelector('[data-reason=AxisUnsure]').click()")
        assert tab.run(shown) == "1"
        tab.run("document.querySelector('[data-reason=AxisUnsure]').click()")
        tab.run(
            "(() => { const t = document.getElementById('text'); t.value = 'cut off'; t.dispatchEvent(new Event('input')); })()"
        )
        assert tab.run(shown) == "1"
        assert tab.complaints == []


def test_a_dead_claim_is_taken_over_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dead, first, second = (Claims(tmp_path) for _ in range(3))
    assert dead.take("a")
    assert not first.take("a")  # it lives
    os.utime(tmp_path / "claims" / "a.claim", (1.0, 1.0))
    seen_dead = second._age(tmp_path / "claims" / "a.claim")
    assert first.take("a")
    assert not dead.pulse("a")
    # one that saw it dead before the other took it over gives the live claim back
    monkeypatch.setattr(second, "_age", lambda _: seen_dead)
    monkeypatch.setattr(
        claims, "read_json", lambda p: {"by": dead.me} if p.suffix == ".claim" else read_json(p)
    )
    assert not second.take("a")
    monkeypatch.undo()
    assert first.pulse("a")
    first.release("a")
    assert second.take("a")
