"""What an inspection tells: findings, and checks that could not be made."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from recon.inspection.findings import value
from recon.inspection.outlook import Outlook
from twin.cause import Cause
from twin.report.sections import Table


@dataclass(frozen=True)
class Unknown:
    """A check that could not be made. check: its name. why: what the recording lacks for it."""

    check: str
    why: str


@dataclass(frozen=True)
class Inspection:
    """What was found in a recording. findings: causes of `FINDINGS`. checked: names of all checks that were
    made. unknown: those that could not be made. frames: how many of `of` frames were looked at."""

    name: str
    findings: tuple[Cause, ...]
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
            "findings": [
                {"finding": f.type, "text": f.text, "help": f.help, "values": f.numbers}
                for f in self.findings
            ],
            "checked": list(self.checked),
            "unknown": [asdict(u) for u in self.unknown],
        }

    def table(self) -> Table:
        """One line for each finding: what is wrong, by how much, and what to do."""
        rows = [[f.kind, value(f), f.help] for f in self.findings]
        return Table(f"{self.name}: what is wrong", ["what", "value", "what to do"], rows)
