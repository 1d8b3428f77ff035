"""The verb `twin completion`: a bash or zsh script that completes verbs, options, settings and names."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from twin.cli.console import Console, Outcome
from twin.cli.parser import parser_of
from twin.cli.table import SETTINGS, VERBS, WORDS, named
from twin.runs.settings_list import listed

_FILES = "@"  # stands for names of files, which the shell completes itself
_ANY = "%"  # stands for a value that nobody can list
_TABLE = """# Completes `twin`; made by `twin completion {shell}`.
# Words that may follow a verb, an action of a verb, or an option of either; @ for names of files, % for a value that nobody can list.
_twin_words() {{
    case "$1" in
{cases}
    esac
}}
# Options that several words may follow.
_twin_many='{many}'
# Words that may follow the words of a command line, the last of which is being typed.
_twin_next() {{
    local current="${{@: -1}}" key="" option="" since=0 word values=""
    shift
    while (($# > 1)); do
        word="$1"
        shift
        if [[ "$word" == -* ]]; then
            option="$word" since=0
        else
            since=$((since + 1))
            [[ -z "$option" && -n "$(_twin_words "${{key:+$key }}$word")" ]] && key="${{key:+$key }}$word"
        fi
    done
    [[ -n "$option" ]] && values="$(_twin_words "$key $option")"
    if [[ -n "$values" && ($since == 0 || " $_twin_many " == *" $key:$option "*) && "$current" != -* ]]; then
        echo "$values"
    else
        _twin_words "$key"
    fi
}}
"""
_WRAPPERS = {
    "bash": """_twin() {
    local words current="${COMP_WORDS[COMP_CWORD]}"
    words="$(_twin_next "${COMP_WORDS[@]:0:COMP_CWORD+1}")"
    COMPREPLY=($(compgen -W "${words//[@%]/}" -- "$current"))
    [[ "$words" == *@* && "$current" != -* ]] && COMPREPLY+=($(compgen -f -- "$current")) && compopt -o filenames
    [[ ${#COMPREPLY[@]} == 1 && "${COMPREPLY[0]}" == *= ]] && compopt -o nospace
    return 0
}
complete -F _twin twin
""",
    "zsh": """_twin() {
    local -a known
    known=(${=$(_twin_next "${(@)words[1,CURRENT]}")})
    [[ "${words[CURRENT]}" != -* ]] && (( ${known[(I)@]} )) && _files
    known=(${known:#[@%]})
    compadd -S '' -- ${(M)known:#*=}
    compadd -- ${known:#*=}
}
if [[ "$funcstack[1]" == _twin ]]; then _twin "$@"; else compdef _twin twin; fi
""",
}


def completion(console: Console, shell: str) -> Outcome:
    """A script for the shell."""
    with console.progress():  # importing what knows the names takes seconds
        text = script(shell)
    return Outcome({"shell": shell, "script": text}, notes=[text.rstrip("\n")])


def script(shell: str) -> str:
    """The text of the script: `shell` is bash or zsh."""
    # by the words that may follow them
    keys: dict[str, list[str]] = {" ".join([*VERBS, "--help", "--version"]): [""]}
    many = []
    for verb in VERBS:
        for key, parser in _parsers(verb, parser_of(verb)):
            keys.setdefault(" ".join([*_positional(parser, key), *_options(parser)]), []).append(key)
            for action in parser._actions:
                for name in action.option_strings if action.nargs != 0 else ():
                    values = " ".join(_values(verb, key, name, action))
                    keys.setdefault(values, []).append(f"{key} {name}")
                    many += [f"{key}:{name}"] if action.nargs == "+" else []
    quoted = {words: "|".join(f"'{key}'" for key in of) for words, of in keys.items()}
    cases = "\n".join(f"        {of}) echo '{words}' ;;" for words, of in quoted.items())
    text = _TABLE.format(shell=shell, cases=cases, many=" ".join(many))
    return ("#compdef twin\n" if shell == "zsh" else "") + text + _WRAPPERS[shell]


def _parsers(key: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """The parser of a verb and those of its actions, each with the words that lead to it."""
    yield key, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                yield f"{key} {name}", inner


def _options(parser: argparse.ArgumentParser) -> list[str]:
    return [name for action in parser._actions for name in action.option_strings if name.startswith("--")]


def _positional(parser: argparse.ArgumentParser, key: str) -> list[str]:
    """What may stand without an option before it."""
    words: list[str] = []
    for action in parser._actions:
        if not action.option_strings:
            words += map(str, action.choices or _names(key))
            words += [_FILES] if action.type is Path else []
    return words


def _values(verb: str, key: str, option: str, action: argparse.Action) -> list[str]:
    """Words that may follow an option: its choices, names from a table, or its metavar's lower-case words."""
    if option == "--set":
        classes = SETTINGS.values() if verb == "config" else [SETTINGS.get(verb, SETTINGS["reconstruct"])]
        return [f"{s.path}=" for home in classes for s in listed(named(home)())]
    if action.choices:
        return [str(c) for c in action.choices]
    words = _names(f"{key} {option}") or _names(option)
    shown = str(action.metavar or "")
    words = words or [
        word for word in shown.split("|") if word.isalpha() and word.islower() and "=" not in shown
    ]
    return [*words, *([_FILES] if action.type is Path else [])] or [_ANY]


def _names(key: str) -> list[str]:
    if key not in WORDS:
        return []
    known = named(WORDS[key])
    return list(known() if callable(known) else known)
