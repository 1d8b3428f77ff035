"""What an inspection tells: findings, and checks that could not be made."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import Any

from recon.inspection.outlook import Outlook
from twin.cause import Cause
from twin.report.sections import Table
from twin.verdict import OfRecording


@dataclass(frozen=True)
class Finding(Cause):
    """One fault of a recording; its fields are the measured values."""

    @property
    def doubts(self) -> bool:
        """Whether a twin that is made of such a recording may be wrong while all else speaks for it."""
        return False

    @property
    @abstractmethod
    def value(self) -> str:
        """By how much, with its numbers."""

    @property
    @abstractmethod
    def help(self) -> str:
        """What to do."""

    @property
    def text(self) -> str:
        """What is wrong, and by how much."""
        return f"{self.kind}: {self.value}"

    @property
    def reason(self) -> OfRecording:
        """The same as a reason against a twin that is made of the recording."""
        return OfRecording("doubtful", type(self).__name__, self.text, self.kind, self.help)

    def as_dict(self) -> dict[str, Any]:
        """JSON types."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {"finding": type(self).__name__, "text": self.text, "help": self.help, "values": values}


@dataclass(frozen=True)
class Unknown:
    """A check that could not be made. check: its name. why: what the recording lacks for it."""

    check: str
    why: str


@dataclass(frozen=True)
class Inspection:
    """What was found in a recording. checked: names of all checks that were made. unknown: those that could
    not be made. frames: how many of `of` frames were looked at."""

    name: str
    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    unknown: tuple[Unknown, ...]
    frames: int
    of: int
    outlook: Outlook

    def as_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {
            "recording": self.name,
            "frames": {"looked_at": self.frames, "of": self.of},
            "outlook": self.outlook.as_dict(),
            "findings": [f.as_dict() for f in self.findings],
            "checked": list(self.checked),
            "unknown": [asdict(u) for u in self.unknown],
        }

    def table(self) -> Table:
        """One line for each finding."""
        rows = [[f.kind, f.value, f.help] for f in self.findings]
        return Table(f"{self.name}: what is wrong", ["what", "value", "what to do"], rows)
