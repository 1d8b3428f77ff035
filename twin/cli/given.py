"""Settings as a command line gives them: from a TOML file, and KEY=VALUE texts on top of it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any, TypeVar

from twin.errors import ConfigError
from twin.runs.settings import from_dict, read_toml

T = TypeVar("T")


def settings(cls: type[T], path: Path | None, assignments: Sequence[str]) -> T:
    """The configuration class, from a TOML file and KEY=VALUE texts on top of it."""
    data, where = given_settings(path, assignments)
    return from_dict(cls, data, where)


def given_settings(path: Path | None, assignments: Sequence[str]) -> tuple[dict[str, Any], str]:
    """Settings as they were given, and by what."""
    data = {} if path is None else read_toml(path)
    where = "--set" if path is None else str(path)
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f"--set {text!r} is not KEY=VALUE", "write for example --set seed=3")
        _assign(data, key.strip().split("."), value.strip())
    return data, where


def put(data: dict[str, Any], table: str, values: Mapping[str, Any]) -> None:
    """Put options of their own, None and [] apart, into a table of settings in place of the file's."""
    said = {name: copy(v) for name, v in values.items() if v not in (None, [])}
    if said and isinstance(place := data.setdefault(table, {}), dict):
        place |= said


def sources(path: Path | None, assignments: Sequence[str]) -> dict[str, str]:
    """What gives each setting that is given, by its dotted path."""
    found = {} if path is None else dict.fromkeys(_paths(read_toml(path)), str(path))
    return found | {text.partition("=")[0].strip(): "--set" for text in assignments}


def _paths(data: Mapping[str, Any], path: str = "") -> Iterator[str]:
    for key, value in data.items():
        if isinstance(value, Mapping):
            yield from _paths(value, f"{path}{key}.")
        else:
            yield path + key


def texts(option: str, assignments: Sequence[str]) -> dict[str, str]:
    """KEY=VALUE texts as a mapping; the values stay texts."""
    data = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ConfigError(
                f"{option} {text!r} is not KEY=VALUE", f"write for example {option} license=CC0-1.0"
            )
        data[key.strip()] = value.strip()
    return data


def _assign(data: dict[str, Any], keys: Sequence[str], text: str) -> None:
    for key in keys[:-1]:
        data = data.setdefault(key, {})
        if not isinstance(data, dict):
            raise ConfigError(f"--set {'.'.join(keys)}: {key!r} is a value, not a table")
    try:
        data[keys[-1]] = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        data[keys[-1]] = text  # a bare word is a text
