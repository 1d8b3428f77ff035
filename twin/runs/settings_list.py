"""Every setting with its value, unit, range and meaning: for `twin config` and for docs/settings.md."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_origin

from twin.runs.setting import Rule, rule_of, types_of
from twin.runs.settings import nested


@dataclass(frozen=True)
class Listed:
    """One setting: its dotted path, its value, the default of today, its field's rule and type."""

    path: str
    value: Any
    default: Any
    rule: Rule
    kind: Any

    @property
    def name(self) -> str:
        """The last word of the path."""
        return self.path.rpartition(".")[2]

    @property
    def changed(self) -> bool:
        """Whether the value is another than the default."""
        return bool(self.value != self.default)

    @property
    def allowed(self) -> str:
        """The range, or the values to choose from; nothing for a text."""
        if get_origin(self.kind) is Literal:
            return " or ".join(get_args(self.kind))
        if bool in (self.kind, *get_args(self.kind)):
            return "true or false"
        return self.rule.range + ", or inf" * self.rule.infinite

    def text(self, value: Any) -> str:
        """A value of this setting for a reader, with its unit: four digits, angles in degrees too."""
        if value is None or isinstance(value, bool):
            return {None: "none", True: "true", False: "false"}[value]
        items = value if isinstance(value, tuple) else (value,)
        numbers = ", ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in items) or "none"
        degrees = (
            f" ({', '.join(f'{math.degrees(v):.4g}' for v in items)}°)" if self.rule.unit == "rad" else ""
        )
        return f"{numbers} {self.rule.unit or ''}".rstrip() + degrees


@dataclass(frozen=True)
class Group:
    """The settings of one class: dotted path of their table (empty for the first), the class' words, each."""

    path: str
    meaning: str
    about: str
    settings: tuple[Listed, ...]


def groups(config: Any, default: Any = None, path: str = "", meaning: str = "") -> Iterator[Group]:
    """The settings of a configuration, table by table, in a TOML file's order, without empty tables.

    default: what to compare with; None takes the defaults of its class.
    """
    default = type(config)() if default is None else default
    inner, kinds = dict(nested(type(config))), types_of(type(config))
    own = [
        Listed(
            f"{path}.{f.name}".lstrip("."),
            getattr(config, f.name),
            getattr(default, f.name),
            rule_of(f),
            kinds[f.name],
        )
        for f in fields(config)
        if f.name not in inner
    ]
    if own:
        yield Group(path, meaning, " ".join((type(config).__doc__ or "").split()), tuple(own))
    for f in fields(config):
        if f.name in inner:
            at = f"{path}.{f.name}".lstrip(".")
            yield from groups(getattr(config, f.name), getattr(default, f.name), at, rule_of(f).meaning)


def listed(config: Any) -> list[Listed]:
    """All settings of a configuration."""
    return [s for g in groups(config) for s in g.settings]
