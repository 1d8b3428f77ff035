"""The cache: computed once, recomputed for a stated reason, and never half written."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from twin.errors import InputError
from twin.files.text import read_json
from twin.geometry import Array
from twin.runs.keys import stage_key
from twin.runs.manifest import seconds_of
from twin.runs.setting import Settings, setting
from twin.runs.settings import load_config
from twin.runs.stages import Run, StageResult
from twin.scene import Prismatic


@dataclass(frozen=True)
class Window:
    size: int = 3


@dataclass(frozen=True)
class Config:
    window: Window = Window()
    seed: int = 0


class Chain:
    """Three stages, a -> b -> c with c reading both, that count how often each is computed."""

    def __init__(self) -> None:
        self.computed: list[str] = []

    def _count(self, name: str, value: Callable[[], Array]) -> Callable[[], Array]:
        def compute() -> Array:
            self.computed.append(name)
            return value()

        return compute

    def go(
        self,
        folder: Path | None,
        *,
        a: Config = Config(),
        b_version: int = 1,
        c: object = None,
        input_: str = "x",
    ) -> dict[str, StageResult[Array]]:
        self.computed = []
        with Run(folder, input_) as run:
            ra = run.stage("a", 1, a, [], self._count("a", lambda: np.arange(4.0) + a.seed))
            rb = run.stage("b", b_version, None, [ra], self._count("b", lambda: ra.value * b_version))
            rc = run.stage("c", 1, c, [ra, rb], self._count("c", lambda: ra.value + rb.value))
        return {"a": ra, "b": rb, "c": rc}


def test_second_run_computes_nothing(tmp_path: Path) -> None:
    chain = Chain()
    first = chain.go(tmp_path)
    assert chain.computed == ["a", "b", "c"]
    second = chain.go(tmp_path)
    assert chain.computed == []
    assert all(r.cached for r in second.values())
    assert np.array_equal(first["c"].value, second["c"].value)
    assert [second[k].seconds for k in "abc"] == [pytest.approx(first[k].seconds, abs=1e-3) for k in "abc"]


def test_memory_and_folder_agree(tmp_path: Path) -> None:
    kept, memory = Chain().go(tmp_path), Chain().go(None)
    assert [kept[k].key for k in "abc"] == [memory[k].key for k in "abc"]
    assert np.array_equal(kept["c"].value, memory["c"].value)


def test_only_dependants_recompute_and_say_why(tmp_path: Path) -> None:
    chain = Chain()
    chain.go(tmp_path)
    r = chain.go(tmp_path, b_version=2)
    assert chain.computed == ["b", "c"]
    assert r["b"].reason == "the stage's version changed from 1 to 2"
    assert r["c"].reason == "it reads b, which changed"
    r = chain.go(tmp_path, b_version=2, a=Config(Window(5)))
    assert chain.computed == ["a", "b", "c"]
    assert r["a"].reason == "window.size changed from 3 to 5"
    assert r["c"].reason == "it reads a, b, which changed"
    r = chain.go(tmp_path, b_version=2, a=Config(Window(5)), c={"k": [1, 2]})
    assert chain.computed == ["c"]
    assert r["c"].reason == "k, which is [1, 2], is a new setting"
    r = chain.go(tmp_path, b_version=2, a=Config(Window(5)), c={"k": [1, 2]}, input_="y")
    assert chain.computed == ["a", "b", "c"]
    assert r["a"].reason == "the recording changed"


def test_settings_may_come_in_groups(tmp_path: Path) -> None:
    for size, why in ((3, "not computed yet"), (4, "0.size changed from 3 to 4")):
        with Run(tmp_path, "x") as run:
            assert run.stage("a", 1, (Window(size), Config()), [], lambda: 1).reason == why


@dataclass(frozen=True)
class Before:
    """What `Today` was in an earlier version."""

    rounds: int = 60
    seed: int = 0


@dataclass(frozen=True)
class Today(Settings):
    window: int = setting(3, "that is compared", unit="px", at_least=1)
    seed: int = setting(0, "of every draw", unit="", at_least=0)


def test_a_stage_of_other_settings_is_computed_again_and_names_them(tmp_path: Path) -> None:
    for config in (Before(rounds=5), Today()):
        with Run(tmp_path, "x") as run:
            reason = run.stage("a", 1, config, [], lambda: 1).reason
    assert "rounds, which was 5, is no longer a setting" in reason
    assert "window, which is 3, is a new setting" in reason


def test_key_tells_every_part_apart() -> None:
    base = {"version": 1, "config": {"a": 1}, "upstream": {"u": "k"}, "input": "x"}
    others = [{"version": 2}, {"config": {"a": 2}}, {"upstream": {"u": "l"}}, {"input": "y"}]
    keys = {stage_key("s", base), stage_key("t", base), *(stage_key("s", base | o) for o in others)}
    assert len(keys) == 6
    assert stage_key("s", dict(reversed(base.items()))) == stage_key("s", base)


def test_renumbered_stages_are_found_again(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as run:
        run.stage("b", 1, None, [], lambda: 1)
    with Run(tmp_path, "x") as run:
        run.stage("a", 1, None, [], lambda: 0)
        assert run.stage("b", 1, None, [], lambda: 1).cached
    assert sorted(p.name for p in (tmp_path / "stages").glob("[0-9]*")) == ["01_a", "02_b"]


@pytest.mark.parametrize("file", ["data.json", "arrays.npz", "stage.json"])
def test_damaged_result_is_recomputed(file: str, tmp_path: Path) -> None:
    chain = Chain()
    expected = chain.go(tmp_path)["c"].value
    path = tmp_path / "stages" / "02_b" / file
    path.write_bytes(path.read_bytes()[:20])
    assert np.array_equal(chain.go(tmp_path)["c"].value, expected)
    assert chain.computed == ["b"]


@pytest.mark.parametrize(
    ("stored", "told"),
    [
        ("twin.room_of_yesterday:Prismatic", "twin.room_of_yesterday:Prismatic is gone"),
        ("twin.joint:Slider", "twin.joint:Slider is gone"),
        ("twin.joint:JointSigma", "the fields of twin.joint:JointSigma are others now (axis, axis_deg"),
    ],
)
def test_a_result_whose_class_moved_or_changed_is_computed_again_with_a_reason(
    stored: str, told: str, tmp_path: Path
) -> None:
    """Classes are stored by module path: a run of an earlier version resumes all the same."""
    value = Prismatic(np.array([1.0, 0, 0]))
    said: list[str] = []
    with Run(tmp_path, "x") as run:
        first = run.stage("joint", 1, None, [], lambda: value)
    data = tmp_path / "stages" / "01_joint" / "data.json"
    text = data.read_text().replace("twin.joint:Prismatic", stored).replace('"axis"', '"axis_deg"')
    data.write_text(text)
    with Run(tmp_path, "x", lambda *told: said.extend(told[2:])) as run:
        again = run.stage("joint", 1, None, [], lambda: value)
    assert not again.cached
    assert again.key == first.key
    assert told in again.reason
    assert "another version of Funtwin" in again.reason
    assert again.reason in said


def test_a_failing_stage_keeps_what_was_computed(tmp_path: Path) -> None:
    def fail() -> int:
        raise InputError("no tracks")

    with Run(tmp_path, "x") as run:
        a = run.stage("a", 1, None, [], lambda: 1)
        with pytest.raises(InputError, match="no tracks"):
            run.stage("b", 1, None, [a], fail)
    with Run(tmp_path, "x") as run:
        assert run.stage("a", 1, None, [], lambda: 1).cached
    assert sorted(p.name for p in (tmp_path / "stages").glob("[0-9]*")) == ["01_a"]


def test_a_failing_write_keeps_the_old_result(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as run:
        run.stage("a", 1, None, [], lambda: 1)
    with Run(tmp_path, "x") as run, pytest.raises(InputError, match="can't be stored"):
        run.stage("a", 2, None, [], object)
    with Run(tmp_path, "x") as run:
        assert run.stage("a", 1, None, [], lambda: 2).value == 1
    assert not list((tmp_path / "stages").glob("*.tmp"))


def test_the_time_of_a_run_is_that_in_which_something_was_computed(tmp_path: Path) -> None:
    """Stages at a time count once, what stood still between two attempts not at all."""
    stages = [
        {"began": 100.0, "seconds": 10.0},
        {"began": 105.0, "seconds": 10.0},
        {"began": 106.0, "seconds": 2.0},
        {"began": 500.0, "seconds": 1.0},
    ]
    assert seconds_of(stages) == pytest.approx(16.0)
    assert seconds_of(list(reversed(stages))) == pytest.approx(16.0)
    assert seconds_of([{"seconds": 3.0}, *stages]) == pytest.approx(26.0), "of an older run: the sum"
    for _ in range(2):
        with Run(tmp_path, "x") as run:
            run.stage("a", 1, None, [], lambda: time.sleep(0.05))
        (told,) = read_json(tmp_path / "manifest.json")["stages"]
        assert time.time() - 30.0 < told["began"] < time.time() - 0.04
        assert 0.04 < seconds_of([told]) < 10.0


def test_warnings_are_kept_with_the_result(tmp_path: Path) -> None:
    def compute() -> int:
        warnings.warn("the hand is in the first frame", stacklevel=1)
        warnings.warn("the hand is in the first frame", stacklevel=1)
        return 1

    for cached in (False, True):
        with Run(tmp_path, "x") as run:
            run.warn("no time stamps")
            assert run.stage("a", 1, None, [], compute).cached is cached
        manifest = read_json(tmp_path / "manifest.json")
        assert manifest["warnings"] == ["no time stamps"]
        assert manifest["stages"][0]["warnings"] == ["the hand is in the first frame"]


def test_manifest_tells_keys_seconds_and_memory(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as run:
        run.stage("a", 1, None, [], lambda: float(np.ones(8_000_000).sum()) or time.sleep(0.05))
    manifest = read_json(tmp_path / "manifest.json")
    (stage,) = manifest["stages"]
    assert manifest["versions"].keys() >= {"python", "numpy"}
    assert len(stage["key"]) == 64
    assert stage["seconds"] > 0
    assert stage["peak_mb"] > 64  # the array alone
    assert stage["reason"] == "not computed yet"


def test_progress_is_told(tmp_path: Path) -> None:
    told: list[tuple[str, float, str]] = []

    def progress(stage: str, fraction: float, message: str = "") -> None:
        told.append((stage, fraction, message))

    for _ in range(2):
        with Run(tmp_path, "x", progress) as run:
            run.stage("a", 1, None, [], lambda run=run: run.report("a", 0.5) or 1)
    assert [(s, f) for s, f, _ in told] == [("a", 0.0), ("a", 0.5), ("a", 1.0), ("a", 1.0)]
    assert told[0][2] == "not computed yet"
    assert told[-1][2] == "from the cache"


def test_loops_tell_how_far_they_are() -> None:
    told: list[float] = []

    def progress(stage: str, fraction: float, message: str = "") -> None:
        told.append(fraction)

    run = Run(None, "x", progress)
    assert list(run.loop("a")(range(4), "frames")) == [0, 1, 2, 3]
    assert told == [0, 0.25, 0.5, 0.75]
    assert list(run.loop("a")(iter("ab"), "of unknown number")) == ["a", "b"]
    assert len(told) == 4


def test_config_is_written_beside_the_results(tmp_path: Path) -> None:
    Run(tmp_path, "x", config=Config(seed=3)).close()
    assert load_config(Config, tmp_path / "config.toml") == Config(seed=3)


def test_a_name_is_used_once() -> None:
    run = Run(None, "x")
    run.stage("a", 1, None, [], lambda: 1)
    with pytest.raises(ValueError, match="unique"):
        run.stage("a", 1, None, [], lambda: 1)


def test_unwritable_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file/run can't be written.*another folder"):
        Run(tmp_path / "file" / "run", "x")


SCRIPT = """
import sys, time
from pathlib import Path
import numpy as np
from twin.runs.stages import Run

folder, pause = Path(sys.argv[1]), sys.argv[2]
class Slow:
    '''Pauses inside of a value's storing: half of the files are written.'''
    def save(self, value, place):
        from twin.runs.codec import TreeCodec
        TreeCodec().save(value, place)
        if pause == "save":
            print("now", flush=True); time.sleep(60)
    def load(self, place):
        from twin.runs.codec import TreeCodec
        return TreeCodec().load(place)
def b(a):
    if pause == "compute":
        print("now", flush=True); time.sleep(60)
    return {"b": np.sqrt(a), "n": 3}
with Run(folder, "x") as run:
    a = run.stage("a", 1, None, [], lambda: np.random.default_rng(0).random((50, 3)))
    b = run.stage("b", 1, None, [a], lambda: b(a.value), Slow())
    c = run.stage("c", 1, None, [b], lambda: b.value["b"].sum(0))
print("done", *(r.cached for r in run.results))
"""


def start(folder: Path, pause: str = "") -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder), pause], stdout=subprocess.PIPE, text=True
    )


def results(folder: Path) -> dict[str, bytes]:
    """All stored values; stage.json holds seconds, which differ from run to run."""
    paths = sorted(p for p in (folder / "stages").rglob("*") if p.is_file() and p.suffix in (".npz", ".json"))
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in paths if p.name != "stage.json"}


@pytest.mark.parametrize("pause", ["compute", "save"])
def test_killed_run_resumes_to_the_same_bytes(pause: str, tmp_path: Path) -> None:
    undisturbed, killed = tmp_path / "undisturbed", tmp_path / "killed"
    assert start(undisturbed).communicate(timeout=60)[0] == "done False False False\n"
    with start(killed, pause) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "now\n"
        process.send_signal(signal.SIGKILL)
    assert sorted(p.name for p in (killed / "stages").glob("[0-9]*")) == ["01_a"]
    assert json.loads((killed / "manifest.json").read_text())["stages"][0]["name"] == "a"
    assert start(killed).communicate(timeout=60)[0] == "done True False False\n"
    assert results(killed) == results(undisturbed)
    assert len(results(killed)) == 6
    assert not list((killed / "stages").glob(".*.tmp"))


def test_two_processes_do_not_share_a_folder(tmp_path: Path) -> None:
    with start(tmp_path, "compute") as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(InputError, match="in use by another process"):
            Run(tmp_path, "x")
        process.kill()
    Run(tmp_path, "x").close()
