"""Parsers of the command line, one a verb; imports nothing heavy."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from twin.cli.examples import EXAMPLES
from twin.cli.options import OPTIONS, points_joined
from twin.cli.table import VERBS
from twin.errors import InputError, nearest_name

# As twin.errors has it; chosen by us: at 0.6 `--start`, an option of other verbs, is taken for `--part`.
_ALIKE = 0.7


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The verb and its options; an unknown verb is answered with the nearest one."""
    verb, *rest = argv or ["--help"]
    if verb.startswith("-"):
        _parser().parse_args([verb])
    if verb not in VERBS:
        close = nearest_name(verb, list(VERBS))
        hint = f"did you mean {close!r}?" if close else f"verbs: {', '.join(VERBS)}"
        raise InputError(f"unknown verb {verb!r}", hint)
    parser, words = parser_of(verb), points_joined(rest)
    read = (
        parser.parse_intermixed_args if verb == "edit" else parser.parse_args
    )  # words on both sides of options
    return read(words, argparse.Namespace(verb=verb))


def parser_of(verb: str) -> argparse.ArgumentParser:
    """The parser of what follows a verb."""
    parser = Parser(prog=f"twin {verb}", description=f"{VERBS[verb][1][0].upper()}{VERBS[verb][1][1:]}.")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of tables")
    if verb in OPTIONS:
        OPTIONS[verb](parser)
    return parser


class _Help(argparse.HelpFormatter):
    """Indented lines, such as examples, stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        fill = super()._fill_text
        return "\n".join(x if x.startswith("  ") else fill(x, width, indent) for x in text.splitlines())


class Parser(argparse.ArgumentParser):
    """Reports wrong usage as wrong input: one line, exit code 1. Options are written out: a shortened one
    would change its meaning when another option is added. Help shows an example, and which options repeat."""

    def __init__(self, **kwargs: Any) -> None:
        example = EXAMPLES.get(str(kwargs.get("prog")).removeprefix("twin "))
        told = {} if example is None else {"epilog": f"example:\n  {example}"}
        super().__init__(**{"formatter_class": _Help, **told, **kwargs, "allow_abbrev": False})

    def add_argument(self, *names: Any, **kwargs: Any) -> Any:
        """Like argparse's; the help of an option that may be repeated says so."""
        if kwargs.get("action") == "append":
            kwargs["help"] += "; may be repeated"
        return super().add_argument(*names, **kwargs)

    def error(self, message: str) -> NoReturn:
        raise InputError(message, f"see `{self.prog} --help`")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Like argparse's, but the error names the nearest choice."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            close = nearest_name(str(value), known)
            hint = f"did you mean {close!r}? " if close else ""
            name = "/".join(action.option_strings) or action.metavar or action.dest
            raise InputError(
                f"argument {name}: invalid choice: {value!r}", f"{hint}choose from {', '.join(known)}"
            )

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Like argparse's, but the error for an unknown option names the nearest one."""
        options, unknown = self.parse_known_args(args, namespace)
        if not unknown:
            return options
        word = unknown[0].partition("=")[0]
        names = [name.lstrip("-") for name in _option_names(self)]
        close = nearest_name(word.lstrip("-"), names, _ALIKE) if word.startswith("-") else ""
        hint = f"did you mean '--{close}'? " if close else ""
        kind = "option" if word.startswith("-") else "argument"
        raise InputError(f"unknown {kind} {word!r}", f"{hint}see `{self.prog} --help`")


def _option_names(parser: argparse.ArgumentParser) -> list[str]:
    """All options that a verb takes, those of its actions included."""
    names: list[str] = []
    for action in parser._actions:
        names += action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            names += [name for sub in action.choices.values() for name in _option_names(sub)]
    return names


def _parser() -> argparse.ArgumentParser:
    from twin import __version__

    width = max(map(len, VERBS))
    verbs = "\n".join(f"  {name:<{width}}  {text}" for name, (_, text) in VERBS.items())
    parser = Parser(
        prog="twin",
        usage="twin VERB ...",
        description="From one recording of a person opening furniture to a twin that a robot opens.",
        epilog=f"verbs:\n{verbs}\n\n`twin VERB --help` tells a verb's options.",
    )
    parser.add_argument("--version", action="version", version=f"funtwin {__version__}")
    return parser
