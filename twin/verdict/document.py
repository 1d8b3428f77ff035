"""Verdicts as plain data, for twin.json and whatever else carries one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from twin.errors import SceneError
from twin.verdict.reason import LEVELS, Reason, StatedReason
from twin.verdict.reasons import REASONS
from twin.verdict.verdict import Verdict


def verdict_document(verdict: Verdict | None) -> dict[str, Any] | None:
    """`level`, and `reasons` with `type`, `level`, `kind`, `text`, `help` and `values` each; None is None."""
    if verdict is None:
        return None
    return {"level": verdict.level, "reasons": [_reason(r) for r in verdict.reasons]}


def verdict_from(document: Mapping[str, Any]) -> Verdict:
    """The inverse. A reason of a type or with values that this version doesn't know is kept as it stands.

    Raises SceneError where no such thing as a verdict stands, or its level is not that of its reasons.
    """
    level, rows = document.get("level"), document.get("reasons")
    if level not in LEVELS:
        raise SceneError(f"a verdict is {', '.join(LEVELS)}, not {level!r:.40}")
    if not isinstance(rows, list) or not all(isinstance(r, Mapping) for r in rows):
        raise SceneError(f"a verdict needs a list of reasons, has {rows!r:.40}")
    verdict = Verdict(tuple(_from(r) for r in rows))
    if verdict.level != level:
        raise SceneError(f"the verdict {level!r} has reasons that make it {verdict.level!r}")
    return verdict


def _reason(reason: Reason) -> dict[str, Any]:
    if isinstance(reason, StatedReason):
        return dict(reason.raw)
    values = {f.name: getattr(reason, f.name) for f in fields(reason) if f.name != "level"}
    return {
        "type": type(reason).__name__,
        "level": reason.level,
        "kind": reason.kind,
        "values": values,
        "text": reason.text,
        "help": reason.help,
    }


def _from(row: Mapping[str, Any]) -> Reason:
    known = REASONS.get(str(row.get("type")))
    try:
        found = None if known is None else known(level=row["level"], **row["values"])
        if found is not None and _reason(found):  # which its text fails where a value is of another kind
            return found
    except (TypeError, ValueError, KeyError, AttributeError, SceneError):
        pass  # what it holds is another version's
    if not isinstance(row.get("text"), str):
        raise SceneError(f"a reason of a verdict needs a text, has {row.get('text')!r:.40}")
    return StatedReason(row.get("level"), dict(row))  # type: ignore[arg-type]
