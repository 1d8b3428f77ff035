"""`twin completion`: what bash and zsh offer for a line that is being typed."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from twin.cli import main as cli
from twin.cli.completion_verb import script
from twin.cli.parser import parser_of
from twin.cli.table import VERBS, WORDS, named

ASK = {
    "bash": 'compopt() { :; }; source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _twin; printf "%s\\n" "${COMPREPLY[@]}"',
    "zsh": """compdef() { : }
_files() { print -l -- "$PWD"/*(:t) }
compadd() { while [[ "$1" != -- ]]; do shift; done; shift; print -l -- ${(M)@:#${words[-1]}*} }
source "$0"; words=("$@"); CURRENT=$#; _twin""",
}


@pytest.fixture(scope="module", params=["bash", "zsh"])
def shell(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    if shutil.which(request.param) is None:
        pytest.skip(f"{request.param} is not installed")
    path = tmp_path_factory.mktemp("completion") / "script"
    path.write_text(script(request.param), encoding="utf-8")
    return request.param, path


def offered(shell: tuple[str, Path], line: str, folder: Path) -> set[str]:
    """Words that the shell offers for the last one of a line."""
    flags = ["-f", "-c"] if shell[0] == "zsh" else ["--norc", "-c"]
    words = [*shlex.split(line), *([""] if line.endswith(" ") else [])]
    done = subprocess.run(
        [shell[0], *flags, ASK[shell[0]], str(shell[1]), *words], capture_output=True, text=True, cwd=folder
    )
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("twin re", {"reconstruct", "replay"}),
        ("twin export --fo", {"--format"}),
        ("twin export --format u", {"urdf", "usd"}),
        ("twin export --format urdf m", {"mjcf"}),
        ("twin export --format urdf --ge", {"--geometry"}),
        ("twin export RUN --room keep --geometry ", {"seen", "bounded", "complete"}),
        ("twin export --set collision.part_p", {"collision.part_pieces="}),
        ("twin trajectory RUN --format c", {"csv"}),
        ("twin physics s", {"show", "set"}),
        ("twin physics set --frictionl", {"--frictionloss", "--frictionloss-interval"}),
        ("twin physics set RUN --mass 3", set()),
        ("twin replay RUN --goal o", {"open"}),
        ("twin replay --robot s", {"spot"}),
        ("twin export clip", {"clip_run"}),
        ("twin reconstruct --config clip", {"clip_run"}),
    ],
)
def test_what_may_follow_is_offered(
    line: str, words: set[str], shell: tuple[str, Path], tmp_path: Path
) -> None:
    (tmp_path / "clip_run").mkdir()
    found = offered(shell, line, tmp_path)
    assert {w for w in found if w.startswith(line.rpartition(" ")[2])} == words


def test_the_script_has_every_option_of_every_verb() -> None:
    text = script("bash")
    for verb in VERBS:
        words = text.split(f"'{verb}') echo '")[1].split("'")[0].split()
        options = {o for a in parser_of(verb)._actions for o in a.option_strings if o.startswith("--")}
        assert options <= set(words), verb


def test_the_command_prints_the_script_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["completion", "bash"]) == 0
    assert capsys.readouterr().out == script("bash")


def test_what_the_table_names_for_completion_exists() -> None:
    for home in WORDS.values():
        found = named(home)
        assert all(isinstance(name, str) for name in (found() if callable(found) else found)), home
