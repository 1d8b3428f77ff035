"""What an exported asset says about itself beyond its content: author, licence, kind, date."""

from __future__ import annotations

import datetime
import os
import re
from dataclasses import dataclass, field

from twin.errors import InputError

FURNITURE = "Q14745"  # Wikidata's item for furniture
_EPOCH = "SOURCE_DATE_EPOCH"  # reproducible-builds.org/specs/source-date-epoch


def _date() -> str:
    """The date of $SOURCE_DATE_EPOCH, else 1970-01-01: a clock would make equal twins differ."""
    seconds = os.environ.get(_EPOCH, "0")
    try:
        return datetime.datetime.fromtimestamp(int(seconds), datetime.UTC).date().isoformat()
    except (ValueError, OverflowError, OSError) as e:
        raise InputError(
            f"${_EPOCH} is {seconds!r}, not a count of seconds", "unset it, or set it to a whole number"
        ) from e


@dataclass(frozen=True)
class AssetInfo:
    """What an asset says about itself beyond its content.

    date: ISO date; by default that of $SOURCE_DATE_EPOCH, else 1970-01-01. qcode: Wikidata item of its kind.
    """

    author: str = "unknown"
    license: str = "unknown"
    category: str = "furniture"
    qcode: str = FURNITURE
    date: str = field(default_factory=_date)

    def __post_init__(self) -> None:
        for name in ("author", "license", "category"):
            if not getattr(self, name).strip():
                raise InputError(f"the asset's {name} is empty", "give a text, or leave it out")
        if not re.fullmatch(r"Q[0-9]+", self.qcode):
            raise InputError(f"{self.qcode!r} is not a Wikidata item", "give one like Q14745 (furniture)")
        try:
            same = datetime.date.fromisoformat(self.date).isoformat() == self.date
        except ValueError:
            same = False
        if not same:
            raise InputError(f"{self.date!r} is not a date", "give one like 2026-01-31")
