"""One change that a user made to a twin, as a line of RUN/edits.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from twin.errors import InputError

SAID = "said"  # the user's word on the recording, which a reconstruction hears; no change of a twin
_KEYS = ("what", "part", "from", "to", "unit", "why", "interval", "measured")


@dataclass(frozen=True)
class Edit:
    """One change. JSON types; lengths in m, angles in rad, masses in kg: `unit` says which.

    what: a name of `twin.edits.KINDS`, or `SAID`. part: the name that the part had then, empty for the twin
    as a whole. to, was: the value now and before. why: the user's reason. interval, measured: of a weighed
    or known number, as `twin physics set` takes them.
    """

    what: str
    part: str
    to: Any = None
    was: Any = None
    unit: str = ""
    why: str = ""
    interval: tuple[float, float] | None = None
    measured: bool = False

    def __str__(self) -> str:
        value = "" if self.to is None else f" = {shown(self.to)} {self.unit}".rstrip()
        return f"{self.what} of {self.part or 'the twin'}{value}"

    @property
    def row(self) -> dict[str, Any]:
        """JSON object; what is empty is left out."""
        told = {
            "what": self.what, "part": self.part, "from": self.was, "to": self.to, "unit": self.unit, "why": self.why,
            "interval": None if self.interval is None else list(self.interval), "measured": self.measured or None,
        }  # fmt: skip
        return {key: value for key, value in told.items() if value not in (None, "")}


def edit_from(row: Any, known: Mapping[str, Any], where: str) -> Edit:
    """The edit of a row of a file. known: kinds by name.

    Raises InputError that names the place and what is wrong there.
    """
    if not isinstance(row, Mapping) or not isinstance(row.get("what"), str):
        raise InputError(f"{where} is no edit: {row!r:.60}", 'write {"what": ..., "part": ..., "to": ...}')
    if row["what"] == SAID and not isinstance(row.get("to"), str):
        raise InputError(f"{where}: {SAID} is a text, not {row.get('to')!r:.40}", "write it in quotes")
    if row["what"] not in (*known, SAID):
        raise InputError(f"{where}: {row['what']!r} can't be edited", f"what can: {', '.join(known)}")
    strange = [k for k in row if k not in _KEYS]
    if strange:
        raise InputError(f"{where}: an edit has no {strange[0]!r}", f"it has {', '.join(_KEYS)}")
    for key in ("part", "unit", "why"):
        if not isinstance(row.get(key, ""), str):
            raise InputError(f"{where}: {key} is a text, not {row[key]!r:.40}", "write it in quotes")
    if not isinstance(row.get("measured", False), bool):
        raise InputError(
            f"{where}: measured is true or false, not {row['measured']!r:.40}", "write one of them"
        )
    interval = row.get("interval")
    if interval is not None and not (
        isinstance(interval, list)
        and len(interval) == 2
        and all(isinstance(v, (int, float)) for v in interval)
    ):
        raise InputError(f"{where}: interval is two numbers, not {interval!r:.40}", "write [low, high]")
    ends = None if interval is None else (float(interval[0]), float(interval[1]))
    return Edit(
        row["what"], row.get("part", ""), row.get("to"), row.get("from"), row.get("unit", ""), row.get("why", ""), ends,
        row.get("measured", False),
    )  # fmt: skip


def shown(value: Any) -> str:
    """A value for people."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(v) for v in value)
    return str(value)
