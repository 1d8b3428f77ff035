"""What `--help` tells beside the options: an example that is understood, and which options may be
repeated."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator

import pytest

from twin.cli import main as cli
from twin.cli.examples import EXAMPLES
from twin.cli.parser import parser_of
from twin.cli.table import SETTINGS, VERBS, named
from twin.runs.settings import from_dict


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser and those of its actions."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.values()


ALL = [p for verb in VERBS for p in parsers(parser_of(verb))]


@pytest.mark.parametrize("parser", ALL, ids=lambda p: p.prog)
def test_help_shows_an_example_that_is_understood(parser: argparse.ArgumentParser) -> None:
    key = parser.prog.removeprefix("twin ")
    example = EXAMPLES[key]
    assert example.startswith(parser.prog)
    assert f"example:\n  {example}" in parser.format_help()
    words = shlex.split(example.split(" > ")[0])
    options = vars(cli.parse(words[1:]))
    if given := options.get("set"):
        data: dict[str, dict[str, int]] = {}
        for text in given:
            (table, name), value = text.split("=")[0].split("."), int(text.split("=")[1])
            data.setdefault(table, {})[name] = value
        from_dict(named(SETTINGS[options.get("what", key)]), data)


def test_every_example_is_of_a_verb_or_an_action() -> None:
    assert {p.prog.removeprefix("twin ") for p in ALL} == set(EXAMPLES)


def test_options_that_repeat_say_so() -> None:
    repeated = [
        (parser.prog, action)
        for parser in ALL
        for action in parser._actions
        if isinstance(action, argparse._AppendAction)
    ]
    assert len(repeated) >= 12
    assert [name for name, a in repeated if not str(a.help).endswith("; may be repeated")] == []


def test_a_choice_that_is_not_there_is_told_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["convert", "REC", "-o", "OUT", "--format", "nativ"]) == 1
    told = (
        "twin: argument --format: invalid choice: 'nativ'; did you mean 'native'? choose from native, tum\n"
    )
    assert capsys.readouterr().err == told
