"""Who may say, before any geometry is known, what moves when and by which joint.

FunREC, supplement 3.5: the model of ablation A1, optional here.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from recon.interaction.joints.type_selection import TypeHint
from recon.recording import Recording
from twin.errors import InputError, ServiceError
from twin.vlm.answer import Fields, json_object

_MOST = 16  # parts that an answer may name


class JointHint(Protocol):
    """Looks at a recording and names joint types and when each part moves; may be wrong."""

    def __call__(self, recording: Recording, folder: Path | None) -> tuple[TypeHint, ...]:
        """folder: where answers may be kept, None for nowhere."""
        ...


@dataclass(frozen=True)
class PrecomputedJointHint:
    """Hints from a JSON file in the form of `read_hints`."""

    path: Path | str

    def __call__(self, recording: Recording, folder: Path | None) -> tuple[TypeHint, ...]:  # noqa: ARG002
        path = Path(self.path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as e:
            raise InputError(f"the joint hint {path} can't be read: {e}", 'give a JSON file, or "vlm"') from e
        try:
            return read_hints(text, len(recording), path.name)
        except ServiceError as e:
            problem = e.problem.replace("the model's answer", str(path))
            raise InputError(problem, 'write {"parts": [{"joint_type": "revolute", ...}]}') from e


def read_hints(text: str, frames: int, source: str) -> tuple[TypeHint, ...]:
    """Hints from JSON: {"parts": [{"object_name", "joint_type": revolute | prismatic | unknown,
    "first_frame", "last_frame"}]}. A part of unknown type gives none.

    Raises ServiceError that names the field: wrong type, or frames beyond the recording's `frames`.
    """
    parts = Fields("", json_object(text)).children("parts")[:_MOST]
    hints = []
    for part in parts:
        kind = part.text("joint_type").lower()
        if kind not in ("revolute", "prismatic", "unknown"):
            part.wrong("joint_type", f"must be revolute, prismatic or unknown, is {kind!r:.40}")
        first, last = part.number("first_frame"), part.number("last_frame")
        if not 0 <= first < last < frames:
            part.wrong("first_frame", f"to last_frame must lie in 0..{frames - 1}, is {first:g} to {last:g}")
        name = part.text("object_name")
        if kind != "unknown":
            said = f"{source}: {json.dumps(name, ensure_ascii=False)} in frames {first:.0f}-{last:.0f}"
            hints.append(
                TypeHint("revolute" if kind == "revolute" else "prismatic", int(first), int(last), said)
            )
    return tuple(hints)
