"""Configuration as frozen dataclasses: read from TOML with unknown keys refused, written back, turned into plain data."""

from __future__ import annotations

import json
import math
import tomllib
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
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
    """Plain data (JSON types) of a dataclass, mapping or sequence; paths and enumerations become strings, as do the
    infinities, which JSON lacks. Raises ConfigError naming the setting that has no plain form; NaN has none."""
    return _plain(config, "config", for_json=True)


def to_toml(config: Any) -> str:
    """TOML text of a dataclass or mapping, from which `from_dict` makes an equal one; settings that are None are left out,
    as TOML has no null. Raises ConfigError naming the setting that has no plain form; NaN has none."""
    lines: list[str] = []
    _write_table(_plain(config, "config"), (), lines)
    return "\n".join(lines) + "\n"


def _plain(value: Any, where: str, for_json: bool = False) -> Any:
    """Dictionaries, lists, None and numbers and texts of Python's own types: numpy's float64 is a float too, but writes itself
    as `np.float64(...)`."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in fields(value) if f.init}
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, Mapping):
        return {str(k): _plain(v, f"{where}: {k}", for_json) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v, f"{where}[{k}]", for_json) for k, v in enumerate(value)]
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        if math.isnan(value):
            raise ConfigError(f"{where} = nan is no number", "give a number")
        number = float(value)
        return repr(number) if for_json and math.isinf(number) else number
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, str):
        return str(value)
    kind = type(value)
    raise ConfigError(f"{where} = {value!r} can't be written: it is a {kind.__module__}.{kind.__qualname__}")


def _write_table(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and v is not None}
    if path:
        lines += [""] if lines else []
        lines.append(f"[{'.'.join(map(_toml_key, path))}]")
    lines += [f"{_toml_key(k)} = {_toml_value(v)}" for k, v in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            _write_table(value, (*path, key), lines)


def _toml_key(key: str) -> str:
    bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if bare else _toml_text(key)


def _toml_text(text: str) -> str:
    """A basic string. JSON's are legal ones but for DEL; half of a surrogate pair is no text."""
    try:
        text.encode()
    except UnicodeEncodeError as e:
        raise ConfigError(f"the text {text!r} can't be written: {e.reason}") from e
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _toml_value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_toml_value(v) for v in value)}]"
    if isinstance(value, dict):
        rows = (f"{_toml_key(k)} = {_toml_value(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(rows) + "}"
    if value is None:
        raise ConfigError("a list with None in it can't be written", "leave it out of the list")
    if isinstance(value, bool):
        return "true" if value else "false"
    # repr(float) keeps every bit and spells the infinities as TOML does.
    return _toml_text(value) if isinstance(value, str) else repr(value)


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
