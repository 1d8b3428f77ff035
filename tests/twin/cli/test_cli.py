"""The command line: quick to answer, one line for what the user can mend, and exit codes that scripts can
trust."""

from __future__ import annotations

import ast
import errno
import inspect
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.makers.twin.stand_ins import stub
from twin.cli import main as cli
from twin.cli import table
from twin.cli.console import Console, Outcome, Table
from twin.errors import InputError

ARGUMENTS: dict[str, list[str]] = {
    "demo": [],
    "simulate": ["scene.xml", "--joint", "hinge", "-o", "rec"],
    "inspect": ["rec"],
    "reconstruct": ["rec", "-o", "run"],
    "import": ["scene.urdf", "-o", "run"],
    "export": ["run"],
    "check": ["run"],
    "replay": ["run"],
    "trajectory": ["run", "--format", "csv", "-o", "out"],
    "evaluate": ["run", "--truth", "truth"],
    "config": [],
    "doctor": [],
    "physics": ["show", "run"],
    "completion": ["bash"],
}


def test_help_is_quick_and_lists_every_verb() -> None:
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "twin", "--help"], capture_output=True, text=True, check=True
    )
    assert time.perf_counter() - start < 5.0  # under a second on an idle machine; tests may share theirs
    for verb in ARGUMENTS:
        assert f"  {verb} " in done.stdout


def test_parsing_imports_nothing_heavy() -> None:
    """What makes `--help` quick, told without a clock."""
    code = (
        "import sys; from twin.cli import main as cli; cli.parse(['reconstruct', 'a', '-o', 'b']); "
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


# Options that a verb hands on together -> who takes them.
GROUPS = {
    "opening": [table.OPEN_RECORDING],
    "shown": ["twin.completion.asset:AssetView"],
    "asked": ["robots.task:MotionRequest", "robots.replay_verb:checked_trials"],
}


@pytest.mark.parametrize("verb", ARGUMENTS)
def test_every_verb_takes_what_its_parser_gives(verb: str) -> None:
    options = vars(cli.parse([verb, *ARGUMENTS[verb]]))
    given = {k: v for k, v in options.items() if k not in ("verb", "json")}
    bound = inspect.signature(table.named(cli.VERBS[verb][0])).bind(console=Console(), **given)
    taken = dict(bound.arguments)
    taken |= taken.pop("options", {})  # of a verb with actions, each of which has its own
    for group, takers in GROUPS.items():
        known = {name for t in takers for name in inspect.signature(table.named(t)).parameters}
        assert taken.get(group, {}).keys() <= known
        taken |= taken.pop(group, {})
    assert taken.keys() == {"console", *given}


@pytest.mark.parametrize("verb", ARGUMENTS)
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([verb, "--help"]) == 0
    assert f"twin {verb}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "options"),
    [
        ("reconstruct REC -o RUN --at 3,4@5 --interval 1:9 --type slide --start 1 --end 2 --layout tum",
         {"at": [(3, 4, 5)], "intervals": [(1, 9)], "types": ["slide"], "start": 1.0, "end": 2.0, "layout": "tum"}),
        ("convert REC -o OUT --layout r3d --format tum", {"layout": "r3d", "into": "tum"}),
        ("simulate SCENE.xml --joint lid -o OUT", {"joint": "lid"}),
        ("replay RUN --part door --goal 0.2 --from-state 15deg", {"parts": ["door"], "goal": "0.2", "from_state": "15deg"}),
        ("replay RUN --goal -5deg --from-state -.1rad", {"goal": "-5deg", "from_state": "-.1rad"}),
        ("trajectory RUN --part door --format csv -o OUT", {"part": "door", "formats": ["csv"]}),
        ("export RUN --format urdf", {"formats": ["urdf"]}),
    ],
)  # fmt: skip
def test_an_option_means_the_same_to_every_verb(line: str, options: dict[str, object]) -> None:
    """A part and a joint are named, seconds cut a recording, a layout is read and a format written."""
    parsed = vars(cli.parse(line.split()))
    assert {k: parsed[k] for k in options} == options


@pytest.mark.parametrize(
    "line",
    [
        "reconstruct REC -o RUN --part 3,4@5",
        "reconstruct REC -o RUN --joint slide",
        "reconstruct REC -o RUN --format tum",
        "convert REC -o OUT --from tum",
        "replay RUN --start close",
        "trajectory RUN --format csv -o OUT --start close",
    ],
)
def test_an_option_of_two_meanings_is_gone(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    option = re.findall("--(?:part|joint|format|from|start)", line)[-1]
    assert cli.run(line.split()) == 1
    assert capsys.readouterr().err.startswith(f"twin: unknown option {option!r}")


def test_options_are_not_shortened(capsys: pytest.CaptureFixture[str]) -> None:
    """`--joi` would mean another option once there are two that begin so."""
    assert cli.run(["simulate", "scene.xml", "--join", "lid", "-o", "rec"]) == 1
    told = "twin: unknown option '--join'; did you mean '--joint'? see `twin simulate --help`\n"
    assert capsys.readouterr().err == told


def test_a_word_unlike_every_verb_gets_no_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    """Half of the letters of "bogus" stand in "robots" too."""
    assert cli.run(["bogus"]) == 1
    assert "did you mean" not in capsys.readouterr().err


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
    assert cli.run(["export", "run"]) == (130 if isinstance(problem, KeyboardInterrupt) else 1)
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
        (["export", "x", "--format", "stl"], ["'stl'", "urdf"]),
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


def test_every_function_that_is_named_by_text_exists() -> None:
    for name in (
        *(home for home, _ in table.VERBS.values()),
        *table.CHAIN.values(),
        *table.SETTINGS.values(),
        table.OPEN_RECORDING,
    ):
        assert callable(table.named(name)), name


def test_functions_are_named_by_text_in_one_table_alone() -> None:
    """Elsewhere an import says it, which type checker and linter see."""
    named = re.compile(r"(twin|recon|robots)(\.\w+)*:\w+")
    root = Path(__file__).parents[3]
    found = {
        f"{path.relative_to(root)}: {node.value}"
        for package in ("twin", "recon", "robots")
        for path in (root / package).rglob("*.py")
        if path != root / "twin/cli/table.py"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and named.fullmatch(node.value)
    }
    assert not found
