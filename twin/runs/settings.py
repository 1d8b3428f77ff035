"""Configuration as frozen dataclasses: read from TOML, unknown keys refused, written back, as plain data."""

from __future__ import annotations

import json
import math
import tomllib
import types
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin

from twin.errors import ConfigError
from twin.runs.setting import SettingError, check, fits, types_of, unknown_key

T = TypeVar("T")


def load_config(cls: type[T], path: Path | str) -> T:
    """Read a TOML file into the dataclass `cls`; tables are nested dataclasses, missing keys are defaults.

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
    return _build(cls, data, f"{where}: ")


def nested(cls: type) -> list[tuple[str, type]]:
    """The fields of a dataclass that hold another one."""
    return [(n, h) for n, h in types_of(cls).items() if isinstance(h, type) and is_dataclass(h)]


def as_dict(config: Any) -> Any:
    """Plain data (JSON types) of a dataclass, mapping or sequence; paths and enumerations become strings, as
    do infinities. Raises ConfigError naming the setting that has no plain form; NaN has none."""
    return _plain(config, "config", for_json=True)


def to_toml(config: Any, note: Callable[[str], str] | None = None) -> str:
    """TOML text of a dataclass or mapping, that `from_dict` turns back; settings that are None are left out,
    as TOML has no null. Raises ConfigError naming the setting that has no plain form; NaN has none.

    note: what to say of a setting, given its dotted path, in a comment above it.
    """
    lines: list[str] = []
    _write_table(_plain(config, "config"), (), lines, note)
    return "\n".join(lines) + "\n"


def _plain(value: Any, where: str, for_json: bool = False) -> Any:
    """Dictionaries, lists, None, numbers and texts of Python's own types, not numpy's (`np.float64(...)`)."""
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


def _write_table(
    table: Mapping[str, Any], path: tuple[str, ...], lines: list[str], note: Callable[[str], str] | None
) -> None:
    def comment(key: str) -> list[str]:
        return [] if note is None else [f"# {note('.'.join((*path, key)))}"]

    if path:
        lines += [""] if lines else []
        lines.append(f"[{'.'.join(map(_toml_key, path))}]")
    for key, value in table.items():
        if not isinstance(value, dict) and value is not None:
            lines += [*comment(key), f"{_toml_key(key)} = {_toml_value(value)}"]
    for key, value in table.items():
        if isinstance(value, dict):
            _write_table(value, (*path, key), lines, note)


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


def _build(cls: type[T], data: Mapping[str, Any], where: str, path: str = "") -> T:
    """`where` and `path`, with the colon and the dot at their ends, open the messages."""
    types_ = types_of(cls)
    for key in data:
        if key not in types_:
            raise unknown_key(key, list(types_), where, path)
    values = {k: _converted(types_[k], v, where, f"{path}{k}") for k, v in data.items()}
    missing = [
        f.name
        for f in fields(cls)  # type: ignore[arg-type]
        if f.init and f.name not in values and f.default is MISSING and f.default_factory is MISSING
    ]
    if missing:
        raise ConfigError(f"{where}key {path + missing[0]!r} is missing")
    try:
        check(cls, values)
        return cls(**values)
    except SettingError as e:
        raise e.under(where + path) from None


def _converted(hint: Any, value: Any, where: str, path: str) -> Any:
    """A value of a file in the type of its field where there is one; whether it fits is left to `check`."""
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        tried = [_converted(a, value, where, path) for a in args if a is not type(None)]
        return next((t for t in tried if fits(hint, t)), value)
    if is_dataclass(hint) and isinstance(hint, type) and isinstance(value, dict):
        return _build(hint, value, where, f"{path}.")
    if origin is tuple and isinstance(value, list):
        of_all = args[:1] * len(value) if args[1:] == (Ellipsis,) else args
        rest = value[len(of_all) :]
        items = zip(of_all, value, strict=False)
        return (*(_converted(a, v, where, f"{path}[{k}]") for k, (a, v) in enumerate(items)), *rest)
    if hint is Path and isinstance(value, str):
        return Path(value)
    if hint is float and (type(value) is int or value in ("inf", "-inf")):  # as JSON has it
        with suppress(OverflowError):
            return float(value)
    return value
