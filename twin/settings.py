"""Configuration as frozen dataclasses: read from TOML with unknown keys refused, written back, turned into plain data."""

from __future__ import annotations

import json
import tomllib
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from twin.errors import ConfigError, nearest_name

T = TypeVar("T")


def load_config(cls: type[T], path: Path | str) -> T:
    """Read a TOML file into the dataclass `cls`; tables are its nested dataclasses, missing keys keep their defaults.

    Raises ConfigError naming file and key for unreadable files, unknown keys, wrong types and refused values.
    """
    return from_dict(cls, read_toml(path), str(path))


def read_toml(path: Path | str) -> dict[str, Any]:
    """The content of a TOML file. Raises ConfigError naming the file."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as e:
        raise ConfigError(f"{path} does not exist", "give the path of a TOML file") from e
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as e:
        raise ConfigError(f"{path} is not readable TOML: {e}", "see https://toml.io for the syntax") from e


def from_dict(cls: type[T], data: Mapping[str, Any], where: str = "config") -> T:
    """Build the dataclass `cls` from plain data. `where` opens the error messages."""
    hints = get_type_hints(cls)
    known = {f.name: f for f in fields(cls) if f.init}  # type: ignore[arg-type]
    for key in data:
        if key not in known:
            close = nearest_name(key, list(known))
            hint = f"did you mean {close!r}?" if close else f"known keys: {', '.join(known) or 'none'}"
            raise ConfigError(f"{where}: unknown key {key!r}", hint)
    values = {key: _convert(hints[key], value, f"{where}: {key}") for key, value in data.items()}
    missing = [n for n, f in known.items() if n not in values and not _has_default(f)]
    if missing:
        raise ConfigError(f"{where}: key {missing[0]!r} is missing")
    return cls(**values)


def as_dict(config: Any) -> Any:
    """Plain data (JSON types) of a dataclass, mapping or sequence; paths and enumerations become strings."""
    if is_dataclass(config) and not isinstance(config, type):
        return {f.name: as_dict(getattr(config, f.name)) for f in fields(config) if f.init}
    if isinstance(config, Mapping):
        return {str(k): as_dict(v) for k, v in config.items()}
    if isinstance(config, Enum):
        return as_dict(config.value)
    if isinstance(config, (list, tuple)):
        return [as_dict(v) for v in config]
    if config is None or isinstance(config, (bool, int, float, str)):
        return config
    if isinstance(config, Path):
        return config.as_posix()
    raise ConfigError(f"a setting of type {type(config).__name__} has no plain form")


def to_toml(config: Any) -> str:
    """TOML text of a dataclass or mapping; settings that are None are left out, as TOML has no null."""
    lines: list[str] = []
    _write_table(as_dict(config), (), lines)
    return "\n".join(lines) + "\n"


def _write_table(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and v is not None}
    if path and (plain or not table):
        lines += [""] if lines else []
        lines.append(f"[{'.'.join(map(_toml_key, path))}]")
    lines += [f"{_toml_key(k)} = {_toml_value(v)}" for k, v in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            _write_table(value, (*path, key), lines)


def _toml_key(key: str) -> str:
    bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if bare else json.dumps(key)


def _toml_value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_toml_value(v) for v in value)}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_toml_key(k)} = {_toml_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, bool):
        return "true" if value else "false"
    # JSON strings are legal TOML basic strings; repr(float) keeps every bit and spells inf and nan as TOML does.
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _has_default(f: Any) -> bool:
    return f.default is not MISSING or f.default_factory is not MISSING


def _convert(hint: Any, value: Any, where: str) -> Any:
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _convert_union(args, value, where)
    if origin is Literal:
        if value not in args:
            raise ConfigError(
                f"{where} = {value!r} is not allowed", f"use one of {', '.join(map(repr, args))}"
            )
        return value
    if is_dataclass(hint) and isinstance(hint, type):
        return from_dict(hint, _expect(dict, value, where), where)
    if origin is tuple:
        return _convert_tuple(args, _expect(list, value, where), where)
    if origin in (list, dict, Mapping):
        return value
    if hint is Any:
        return value
    if hint is Path:
        return Path(_expect(str, value, where))
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return _expect(hint, value, where)


def _convert_union(args: tuple[Any, ...], value: Any, where: str) -> Any:
    options = [a for a in args if a is not type(None)]
    for option in options[:-1]:
        try:
            return _convert(option, value, where)
        except ConfigError:
            continue  # the next alternative may fit; the last one speaks for all
    return _convert(options[-1], value, where)


def _convert_tuple(args: tuple[Any, ...], value: list[Any], where: str) -> tuple[Any, ...]:
    if len(args) == 2 and args[1] is Ellipsis:
        return tuple(_convert(args[0], v, f"{where}[{k}]") for k, v in enumerate(value))
    if len(args) != len(value):
        raise ConfigError(f"{where} must hold {len(args)} values, got {len(value)}")
    return tuple(_convert(a, v, f"{where}[{k}]") for k, (a, v) in enumerate(zip(args, value, strict=True)))


def _expect(kind: Any, value: Any, where: str) -> Any:
    wrong_bool = isinstance(value, bool) and kind is not bool
    if wrong_bool or not isinstance(value, kind):
        names = {
            float: "a number",
            int: "a whole number",
            str: "a text",
            bool: "true or false",
            dict: "a table",
        }
        wanted = names.get(kind, "a list" if kind is list else getattr(kind, "__name__", str(kind)))
        raise ConfigError(f"{where} = {value!r} must be {wanted}")
    return value
