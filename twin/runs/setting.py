"""One setting: its meaning, unit and range, stated beside the field; and the validator of values."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, Self, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from twin.errors import ConfigError, nearest_name

T = TypeVar("T")
_KEY = "setting"
_KNOWN = 6  # names in a message, which stays one line
_SHOWN = 30  # characters of a value in a message, which stays one line


@dataclass(frozen=True)
class Rule:
    """What a field declares. The bounds hold for a number, or for each number of a tuple; `above` and `below`
    leave the bound out. unit: "" where there is none. infinite: whether a bound may be infinite."""

    meaning: str = ""
    unit: str | None = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    infinite: bool = False

    @property
    def bounds(self) -> tuple[float, ...]:
        """The bounds that are given."""
        given = (self.above, self.at_least, self.below, self.at_most)
        return tuple(b for b in given if b is not None)

    @property
    def range(self) -> str:
        """Words without unit: "at least 1", "above 0 and below 0.5", "from 0 to 1"; empty without bounds."""
        if self.at_least is not None and self.at_most is not None:
            return f"from {self.at_least:.6g} to {self.at_most:.6g}"
        words = (
            ("above", self.above),
            ("at least", self.at_least),
            ("below", self.below),
            ("at most", self.at_most),
        )
        return " and ".join(f"{word} {bound:.6g}" for word, bound in words if bound is not None)

    def allows(self, value: float) -> bool:
        """Whether a number is in the range. Never NaN."""
        return (
            not math.isnan(value)
            and (self.infinite or math.isfinite(value))
            and (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.below is None or value < self.below)
            and (self.at_most is None or value <= self.at_most)
        )

    @property
    def wanted(self) -> str:
        """The range with its unit, as the end of a sentence that begins with "must be"."""
        unit = self.unit or ""
        if self.bounds == (1,) and len(unit) > 2:
            unit = unit.removesuffix("s")  # at least 1 frame
        return f"{self.range or ('a number' if self.infinite else 'finite')} {unit}".strip()


class SettingError(ConfigError):
    """A value that a setting does not take: its name in its class, and what is wrong with the value."""

    def __init__(self, name: str, fault: str, remedy: str = "", owner: str = "") -> None:
        super().__init__(f"{owner}{name} {fault}", remedy)
        self.name, self.fault = name, fault

    def under(self, owner: str) -> SettingError:
        """The same error, said of a setting whose place is known: "motion.joint."."""
        return SettingError(self.name, self.fault, self.remedy, owner)


class Settings:
    """Base of the frozen dataclasses that hold settings: checks every field when an object is made.

    A class with conditions between fields extends `__post_init__` and raises `refused`.
    """

    def __post_init__(self) -> None:
        check(type(self), vars(self))

    def refused(self, name: str, wanted: str) -> SettingError:
        """The error for a field whose value does not go with another's; `wanted` follows "must"."""
        return SettingError(
            name, f"= {_text(getattr(self, name))} must {wanted}", owner=f"{type(self).__name__}."
        )

    def with_(self, **changes: Any) -> Self:
        """The settings with some of them changed, groups by name: `config.with_(labels={"every": 2})`.

        Lists stand for tuples, as in a file. Raises ConfigError that names the setting.
        """
        return _changed(self, changes, "")


def _changed(config: T, changes: Mapping[str, Any], path: str) -> T:
    """`path`, with the dot at its end, opens the messages."""
    known, values = types_of(type(config)), {}
    for name, value in changes.items():
        if name not in known:
            raise unknown_key(name, list(known), path=path)
        now = getattr(config, name)
        grouped = isinstance(value, Mapping) and is_dataclass(now)
        values[name] = _changed(now, value, f"{path}{name}.") if grouped else _with_tuples(value)
    try:
        return cast(T, replace(cast(Any, config), **values))
    except SettingError as e:
        raise e.under(path) from None


def _with_tuples(value: Any) -> Any:
    return tuple(map(_with_tuples, value)) if isinstance(value, list | tuple) else value


def unknown_key(key: str, known: Sequence[str], where: str = "", path: str = "") -> ConfigError:
    """The error for an unknown setting; `where` and `path`, with colon and dot at their ends, open it."""
    close = nearest_name(key, list(known))
    names = ", ".join(known[:_KNOWN]) + (", ..." if len(known) > _KNOWN else "")
    hint = f"did you mean {path + close!r}?" if close else f"known keys: {names or 'none'}"
    return ConfigError(f"{where}unknown key {path + key!r}", hint)


def setting(
    default: T,
    meaning: str,
    *,
    unit: str | None = None,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    infinite: bool = False,
) -> T:
    """A field of a settings class with its default; see `Rule` for the rest."""
    rule = Rule(meaning, unit, above, at_least, below, at_most, infinite)
    return field(default=default, metadata={_KEY: rule})


def group(factory: Callable[[], T], meaning: str) -> T:
    """A field that holds the settings of another class, made by `factory`."""
    return field(default_factory=factory, metadata={_KEY: Rule(meaning)})


def rule_of(f: Field[Any]) -> Rule:
    """What a field declares; a field that is no setting takes any value of its type but NaN."""
    return cast(Rule, f.metadata.get(_KEY, Rule(infinite=True)))


def types_of(cls: type) -> Mapping[str, Any]:
    """Field -> type of a dataclass, the fields in their order."""
    return _types_of(cls)


@cache
def _types_of(cls: Hashable) -> Mapping[str, Any]:
    hints = get_type_hints(cls)
    return {f.name: hints[f.name] for f in fields(cast(Any, cls)) if f.init}


def check(cls: type, values: Mapping[str, Any]) -> None:
    """Hold values to the types and ranges of fields. Raises SettingError naming class, setting and range."""
    declared = {f.name: f for f in fields(cls)}
    for name, hint in types_of(cls).items():
        if name in values:
            try:
                _check(name, hint, values[name], rule_of(declared[name]))
            except SettingError as e:
                raise SettingError(e.name, e.fault, _default(declared[name]), f"{cls.__name__}.") from None


def fits(hint: Any, value: Any) -> bool:
    """Whether a value is of a type."""
    try:
        _check("", hint, value, Rule(infinite=True))
    except SettingError:
        return False
    return True


def _check(name: str, hint: Any, value: Any, rule: Rule) -> None:
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        options = [a for a in args if a is not type(None)]
        if value is not None or len(options) == len(args):
            fitting = next((o for o in options if fits(o, value)), options[-1])
            _check(name, fitting, value, rule)
    elif origin is Literal:
        if value not in args:
            raise _wrong(name, value, f"must be one of {', '.join(map(repr, args))}")
    elif origin is tuple:
        _check_tuple(name, args, value, rule)
    elif hint in (int, float):
        _check_number(name, hint, value, rule)
    elif isinstance(hint, type) and hint is not Any and not isinstance(value, hint):  # Any is a class too
        names = {str: "a text", bool: "true or false", Path: "a path"}
        wanted = "a table" if is_dataclass(hint) else names.get(hint, f"a {hint.__name__}")
        raise _wrong(name, value, f"must be {wanted}")


def _check_tuple(name: str, args: tuple[Any, ...], value: Any, rule: Rule) -> None:
    if not isinstance(value, tuple):
        raise _wrong(name, value, "must be a list" if not isinstance(value, list) else "must be a tuple")
    endless = len(args) == 2 and args[1] is Ellipsis
    if not endless and len(value) != len(args):
        raise SettingError(name, f"must hold {len(args)} values, got {len(value)}")
    for k, item in enumerate(value):
        _check(f"{name}[{k}]", args[0 if endless else k], item, rule)


def _check_number(name: str, hint: type, value: Any, rule: Rule) -> None:
    kind = Integral if hint is int else Real
    if isinstance(value, bool) or not isinstance(value, kind):
        raise _wrong(name, value, "must be a whole number" if hint is int else "must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not rule.allows(number):
        raise _wrong(name, value, f"must be {rule.wanted}")


def _wrong(name: str, value: Any, fault: str) -> SettingError:
    return SettingError(name, f"= {_text(value)} {fault}")


def _default(f: Field[Any]) -> str:
    return "" if f.default is MISSING else f"the default is {_text(f.default)}"


def _text(value: Any) -> str:
    """A value in a message: numpy's numbers as numbers, long ones cut off."""
    text = str(value) if isinstance(value, Real) else repr(value)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
