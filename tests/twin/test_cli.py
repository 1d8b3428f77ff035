"""The command line: quick to answer, one line for what the user can mend, and exit codes that scripts can trust."""

from __future__ import annotations

import errno
import inspect
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.twin.scenes import cabinet_twin
from twin import cli, steps, verbs
from twin.console import Console, Outcome, Table
from twin.errors import ConfigError, InputError, PlanningError
from twin.stages import Run
from twin.storage import load, save

ARGUMENTS: dict[str, list[str]] = {
    "demo": [],
    "simulate": ["scene.xml", "--joint", "hinge", "-o", "rec"],
    "reconstruct": ["rec", "-o", "run"],
    "export": ["run"],
    "check": ["run"],
    "replay": ["run"],
    "trajectory": ["run", "--format", "csv", "-o", "out"],
    "evaluate": ["run", "--truth", "truth"],
    "doctor": [],
    "physics": ["show", "run"],
}


def stub(monkeypatch: pytest.MonkeyPatch, verb: str, answer: Any) -> list[dict[str, Any]]:
    """Replace a verb's function; returns the list of options it is called with."""
    calls: list[dict[str, Any]] = []

    def function(**options: Any) -> Outcome:
        calls.append(options)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    monkeypatch.setattr(verbs, verb, function)
    return calls


@pytest.fixture(autouse=True)
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page without its pictures, which have tests of their own."""
    from twin.report import page

    monkeypatch.setattr(page, "_pictures", lambda _: {"opening": [], "dollhouse": ""})


def test_help_is_quick_and_lists_every_verb() -> None:
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "twin.cli", "--help"], capture_output=True, text=True, check=True
    )
    assert time.perf_counter() - start < 5.0  # under a second on an idle machine; tests may share theirs
    for verb in ARGUMENTS:
        assert f"  {verb} " in done.stdout


def test_parsing_imports_nothing_heavy() -> None:
    """What makes `--help` quick, told without a clock."""
    code = (
        "import sys; from twin import cli; cli._parse(['reconstruct', 'a', '-o', 'b']); "
        "print(sorted({m.split('.')[0] for m in sys.modules} & set(sys.argv[1:])))"
    )
    heavy = [
        "open3d",
        "mujoco",
        "scipy",
        "cv2",
        "matplotlib",
        "numba",
        "trimesh",
        "pxr",
        "jinja2",
        "recon",
        "robots",
        "av",
    ]
    done = subprocess.run([sys.executable, "-c", code, *heavy], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("verb", ARGUMENTS)
def test_every_verb_takes_what_its_parser_gives(verb: str) -> None:
    options = vars(cli._parse([verb, *ARGUMENTS[verb]]))
    module, _, name = cli.VERBS[verb][0].partition(":")
    function = getattr(import_module(module), name)
    inspect.signature(function).bind(
        console=Console(), **{k: v for k, v in options.items() if k not in ("verb", "json")}
    )


@pytest.mark.parametrize("verb", ARGUMENTS)
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([verb, "--help"]) == 0
    assert f"twin {verb}" in capsys.readouterr().out


def test_no_arguments_show_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([]) == 0
    assert "reconstruct" in capsys.readouterr().out


@pytest.mark.parametrize(("ok", "code"), [(True, 0), (False, 2)])
def test_exit_code_tells_a_missed_goal(ok: bool, code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stub(monkeypatch, "check", Outcome({}, ok=ok))
    assert cli.run(["check", "run"]) == code


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (
            InputError("color/3.jpg is cut short", "copy it again"),
            ["color/3.jpg is cut short; copy it again"],
        ),
        (InputError("two\nlines"), ["two lines"]),
        (
            OSError(errno.ENOSPC, "No space left on device", "run/x"),
            ["run/x", "No space left", "free some space"],
        ),
        (
            PermissionError(errno.EACCES, "Permission denied", "run"),
            ["run", "Permission denied", "may read and write"],
        ),
        (KeyboardInterrupt(), ["interrupted", "again"]),
    ],
)
def test_what_the_user_can_mend_is_one_line(
    problem: BaseException,
    words: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    stub(monkeypatch, "export", problem)
    assert cli.run(["export", "run"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("twin: ")
    assert captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err


@pytest.mark.parametrize(
    "bug", [ValueError("x"), FileNotFoundError(errno.ENOENT, "x"), AssertionError(), KeyError("x")]
)
def test_bugs_keep_their_traceback(bug: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    stub(monkeypatch, "export", bug)
    with pytest.raises(type(bug)):
        cli.run(["export", "run"])


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["reconstrut", "x"], ["unknown verb 'reconstrut'", "did you mean 'reconstruct'?"]),
        (["zzz"], ["unknown verb 'zzz'", "verbs: demo, simulate"]),
        (["reconstruct", "x"], ["-o", "required", "twin reconstruct --help"]),
        (["export", "x", "--format", "glb"], ["'glb'", "urdf"]),
        (["evaluate", "x"], ["--truth"]),
        (["--verbose"], ["--verbose"]),
    ],
)
def test_wrong_usage_is_one_line(
    argv: list[str], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(argv) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    for word in words:
        assert word in err


def test_json_is_one_object(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("t", ["a"], [["1"]])
    stub(monkeypatch, "check", Outcome({"rows": [1]}, [table], ["note"], ["careful"], ok=False))
    assert cli.run(["check", "run", "--json"]) == 2
    assert json.loads(capsys.readouterr().out) == {"ok": False, "rows": [1], "warnings": ["careful"]}
    stub(monkeypatch, "check", InputError("no", "yes"))
    assert cli.run(["check", "run", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"ok": False, "error": "no", "remedy": "yes"}


def test_tables_and_warnings_are_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table = Table("the [title]", ["part", "result"], [["door", "ok"], ["[b]drawer", "FAILED"]])
    stub(monkeypatch, "check", Outcome({}, [table], ["see [here]"], ["mind the gap"]))
    cli.run(["check", "run"])
    out = capsys.readouterr().out
    for words in ("the [title]", "door", "[b]drawer", "FAILED", "see [here]", "warning: mind the gap"):
        assert words in out


def test_progress_on_a_pipe_is_a_line_a_stage(capsys: pytest.CaptureFixture[str]) -> None:
    with Console().progress() as progress:
        progress("tracks", 0.0, "not computed yet")
        progress("tracks", 0.5)
        progress("tracks", 1.0, "3.1 s")
    captured = capsys.readouterr()
    assert captured.err.splitlines() == ["tracks       3.1 s"]
    assert captured.out == ""
    with Console(quiet=True).progress() as progress:
        progress("tracks", 1.0, "3.1 s")
    assert capsys.readouterr().err == ""


def test_progress_bars_follow_the_stages(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Console().progress() as progress:
        for fraction in (0.0, 0.5, 1.0):
            progress("tracks", fraction, "[why]")
        progress("cameras", 0.0, "")
    err = capsys.readouterr().err
    assert "tracks" in err
    assert "[why]" in err
    assert "cameras" in err


@dataclass(frozen=True)
class Settings:
    """Stands for a configuration class."""

    seed: int = 0
    name: str = "a"
    sizes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Nested:
    """Stands for a configuration of stages."""

    labels: Settings = Settings()


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch) -> None:
    real = steps.named
    monkeypatch.setattr(steps, "named", lambda name: {"s": Settings, "n": Nested}.get(name) or real(name))


@pytest.mark.usefixtures("settings")
def test_settings_come_from_file_and_command_line(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text("[labels]\nseed = 3\nname = 'b'\n")
    got = verbs._settings(
        "n", tmp_path / "c.toml", ["labels.seed=4", "labels.sizes=[1, 2]", "labels.name=word"]
    )
    assert got == Nested(Settings(4, "word", (1, 2)))
    assert verbs._settings("s", None, []) == Settings()


@pytest.mark.usefixtures("settings")
@pytest.mark.parametrize(
    ("assignments", "words"),
    [
        (["seed"], "'seed' is not KEY=VALUE"),
        (["sed=1"], "did you mean 'seed'"),
        (["seed=x"], "seed = 'x' must be a whole number"),
        (["seed=1", "seed.x=1"], "'seed' is a value, not a table"),
    ],
)
def test_wrong_settings_are_named(assignments: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        verbs._settings("s", None, assignments)


def test_missing_settings_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no\.toml does not exist"):
        verbs._settings("s", tmp_path / "no.toml", [])


# What the verbs hand on: the reconstruction, the robots and the judges are stood in for.


@dataclass(frozen=True)
class Trajectory:
    goal: float
    start: float = 0.0
    grasp: str = "bar"


@dataclass(frozen=True)
class Replayed:
    opening_peak: float
    ok: bool
    reason: str = ""
    opening_final: float = 0.9
    slip_mm: float = 1.25
    torque_share: tuple[float, ...] = (0.1, 0.5)
    grasp: str = "bar"
    pedestal: float = 0.4
    reached: float = 0.9

    def to_json(self) -> dict[str, Any]:
        return {"ok": self.ok, "opening_peak": self.opening_peak}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


def stand_in(monkeypatch: pytest.MonkeyPatch, **functions: Any) -> None:
    """Replace what verbs import by name: keys are the names' last words."""
    real = steps.named
    monkeypatch.setattr(steps, "named", lambda name: functions.get(name.partition(":")[2]) or real(name))


def test_replay_opens_every_part_and_keeps_the_result(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    planned: list[tuple[int, str]] = []
    tasks: list[tuple[str, str | None]] = []

    def plan(twin: Any, part: int, robot: str, *, goal: str, start: str | None) -> Trajectory:
        tasks.append((goal, start))
        planned.append((part, robot))
        if part == 3:
            raise PlanningError("the drawer is out of reach by 0.30 m", "raise the base")
        upper = twin.part(part).joint.upper
        return Trajectory(0.0, upper) if goal == "close" else Trajectory(upper)

    def replay(twin: Any, trajectory: Trajectory, out: Path, *, robot: str, config: Any) -> Replayed:
        name = "door_close" if trajectory.goal == 0 else "door"
        assert out == run / "replay" / "franka" / name
        return Replayed(0.98, ok=True)

    stand_in(monkeypatch, plan=plan, replay=replay)
    assert cli.run(["replay", str(run)]) == 2
    out = capsys.readouterr().out
    assert planned == [(2, "franka"), (3, "franka")]
    assert "98 %" in out
    assert "out of reach by 0.30 m" in out
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "98 %" in page
    assert "out of reach" in page
    assert cli.run(["replay", str(run / "twin"), "--part", "door"]) == 0
    assert planned[2:] == [(2, "franka")]
    assert cli.run(["replay", str(run), "--part", "door", "--goal", "close"]) == 0
    assert tasks == [("open", None)] * 3 + [("close", None)]
    assert cli.run(["replay", str(run), "--part", "window"]) == 1
    assert "its parts are: door (id 2), drawer (id 3)" in capsys.readouterr().err


def test_replay_of_a_missed_goal_exits_with_two(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(
        monkeypatch,
        plan=lambda *_, **__: Trajectory(1.0),
        replay=lambda *_, **__: Replayed(0.5, False, "slipped"),
    )
    assert cli.run(["replay", str(run), "--part", "2"]) == 2


def test_a_failed_reconstruction_still_renders_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reconstruct(recording: Any, config: Any, *, out: Path, progress: Any, hint: Any) -> None:
        with Run(out, "x", progress) as run:
            run.stage("tracks", 1, None, [], lambda: 1)
            raise InputError("nothing moves in it", "record an opening")

    stand_in(monkeypatch, open_recording=lambda *_: None, reconstruct=reconstruct, ReconConfig=Settings)
    assert cli.run(["reconstruct", "rec", "-o", str(tmp_path / "run")]) == 1
    assert "tracks" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_reconstruct_hands_on_its_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []

    def reconstruct(recording: Any, config: Any, *, out: Path, progress: Any, hint: Any) -> Any:
        asked.extend([recording, config])
        with Run(out, "x", progress) as run:
            run.warn("no time stamps")
        save(cabinet_twin(), out / "twin")
        return load(out)

    stand_in(monkeypatch, open_recording=lambda *a: a, reconstruct=reconstruct, ReconConfig=Settings)
    argv = ["reconstruct", "rec", "-o", str(tmp_path / "run"), "--format", "tum", "--set", "seed=7"]
    assert cli.run(argv) == 0
    assert asked == [(Path("rec"), "tum"), Settings(7)]
    out = capsys.readouterr().out
    for words in (
        "door",
        "revolute",
        "0.0 to 80.2 °",
        "drawer",
        "0.0 to 300.0 mm",
        "warning: no time stamps",
    ):
        assert words in out


def test_export_keeps_the_collision_shapes_with_the_twin(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Files(dict[str, Path]):
        warnings = ("usd: friction loss is left out",)

    full = load(run)
    bare = cabinet_twin(name="bare")

    def export(twin: Any, folder: Path, formats: Sequence[str], package: str, asset: Any) -> Files:
        assert (list(formats), package, asset.author) == (["urdf"], "bare_kitchen", "Me")
        return Files(urdf=folder / "x.urdf")

    stand_in(monkeypatch, complete=lambda *_: bare, export=export)
    options = ["--format", "urdf", "--package", "bare_kitchen", "--asset", "author=Me"]
    assert cli.run(["export", str(run), *options]) == 0
    assert load(run).name == "bare" != full.name
    out = capsys.readouterr().out
    assert "x.urdf" in out
    assert "warning: usd: friction loss is left out" in out


def test_check_shows_the_worst_of_each_quantity_and_what_fails(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin.check import CheckReport, CheckRow

    def row(program: str, field: str, difference: float) -> CheckRow:
        return CheckRow("urdf", program, field, "door", "1", "2", difference, 1e-3)

    def check(twin: Any, files: dict[str, Path], engines: Sequence[str]) -> CheckReport:
        assert engines == ("mujoco", "pinocchio", "yourdfpy")
        assert files == {"urdf": run / "export" / "urdf" / "cabinet.urdf"}
        rows = (
            row("mujoco", "axis_deg", 1e-6),
            row("mujoco", "axis_deg", 2e-5),
            row("pinocchio", "axis_deg", 0.0625),
        )
        return CheckReport(rows, ("urdf/mujoco: odd",))

    assert cli.run(["check", str(run), "--format", "urdf"]) == 1
    assert "run `twin export" in capsys.readouterr().err
    (run / "export" / "urdf").mkdir(parents=True)
    (run / "export" / "urdf" / "cabinet.urdf").write_text("<robot/>")
    monkeypatch.setattr("twin.check.proofs.check", check)
    assert cli.run(["check", str(run), "--format", "urdf"]) == 2
    out = capsys.readouterr().out
    for words in (
        "2e-05",
        "0.06",
        "0.0625",
        "FAILED",
        "2 of 3 comparisons agree",
        "warning: urdf/mujoco: odd",
    ):
        assert words in out
    assert "urdf/mujoco: odd" in (run / "report.html").read_text(encoding="utf-8")


def test_a_folder_without_twin_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["export", str(tmp_path)]) == 1
    assert "holds no twin.json" in capsys.readouterr().err


def test_doctor_reports_and_exits_with_one_when_something_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from twin import doctor

    def diagnose(findings: Sequence[doctor.Finding]) -> None:
        monkeypatch.setattr(doctor, "diagnose", lambda: list(findings))

    diagnose([doctor.Finding("python", True, "3.11")])
    assert cli.run(["doctor"]) == 0
    assert "everything that is needed is here" in capsys.readouterr().out
    diagnose([doctor.Finding("libgl1", False, "not found", "apt-get install -y libgl1")])
    assert cli.run(["doctor"]) == 1
    captured = capsys.readouterr()
    assert "missing" in captured.out
    assert captured.err.splitlines()[-1].endswith("run: apt-get install -y libgl1")
