"""Why something is doubted, refused, failed or found wrong: one type of cause, and tables of its words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import degrees, isfinite
from string import Formatter
from typing import Any, Self

from twin.errors import SceneError

Numbers = Mapping[str, Any]
# A format string over a cause's numbers (docs/verdicts.md), or what chooses one by them.
Template = str | Callable[[Numbers], str]
# What a number (m, s, m^2, rad, share) is multiplied by for a unit behind its format: {travel_m:.0f mm}
_UNITS = {"mm": 1000.0, "ms": 1000.0, "cm²": 1e4, "deg": degrees(1.0), "%": 100.0}


@dataclass(frozen=True)
class Words:
    """What causes of one type say. numbers: the names of their numbers, in order. kind, text, help: as of a
    Cause, by its numbers; text may name its kind too."""

    numbers: str
    kind: Template
    text: Template
    help: Template = ""


@dataclass(frozen=True)
class Cause:
    """One cause.

    type: its name in the table of its words, by which code and files tell it from others. kind: what happened
    without numbers, equal for causes that are alike. numbers: what it was told by, by name; texts and truth
    values too. text: what happened with its numbers, in one line. help: what to do.
    """

    type: str
    kind: str
    numbers: Numbers = field(hash=False)
    text: str
    help: str

    @classmethod
    def told(cls, table: Mapping[str, Words], type: str, *values: Any, **more: Any) -> Self:
        """The cause of a type in a table by its numbers, in the table's order; more: fields of a subclass.

        Raises KeyError for another type, ValueError for more or fewer numbers, SceneError for one that is not
        finite, which no file could hold.
        """
        words = table[type]
        numbers = dict(zip(words.numbers.split(), values, strict=True))
        for name, value in numbers.items():
            if isinstance(value, float) and not isfinite(value):
                raise SceneError(f"{type}.{name} must be finite, got {value}")
        kind = _said(words.kind, numbers)
        text = _said(words.text, {**numbers, "kind": kind})
        return cls(type=type, kind=kind, numbers=numbers, text=text, help=_said(words.help, numbers), **more)


class _Formatter(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        spec, _, unit = format_spec.partition(" ")
        return f"{_UNITS[unit] * value:{spec}} {unit}" if unit else format(value, spec)


def _said(template: Template, numbers: Numbers) -> str:
    return _Formatter().vformat(template if isinstance(template, str) else template(numbers), (), numbers)
