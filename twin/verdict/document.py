"""Verdicts as plain data, for twin.json and whatever else carries one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from twin.errors import SceneError
from twin.verdict.reason import LEVELS, Reason
from twin.verdict.verdict import Verdict


def verdict_document(verdict: Verdict | None) -> dict[str, Any] | None:
    """`level`, `probability` where it is known, and `reasons` with `type`, `level`, `kind`, `values`, `text`
    and `help` each; `word` and `overruled` where the user overruled it. JSON types. None stays None."""
    if verdict is None:
        return None
    known: dict[str, Any] = {} if verdict.probability is None else {"probability": verdict.probability}
    said: dict[str, Any] = {"word": verdict.word} if verdict.word else {}
    if verdict.overruled:
        said["overruled"] = [_reason(r) for r in verdict.overruled]
    return {"level": verdict.level, **known, "reasons": [_reason(r) for r in verdict.reasons], **said}


def verdict_from(document: Mapping[str, Any]) -> Verdict:
    """The inverse. A reason says what it said when it was written, whatever its type says in this version.

    Raises SceneError where no such thing as a verdict stands, or its level is not that of its reasons.
    """
    level, word = document.get("level"), document.get("word", "")
    rows, overruled = document.get("reasons"), document.get("overruled", [])
    if level not in LEVELS:
        raise SceneError(f"a verdict is {', '.join(LEVELS)}, not {level!r:.40}")
    for told_by in (rows, overruled):
        if not isinstance(told_by, list) or not all(isinstance(r, Mapping) for r in told_by):
            raise SceneError(f"a verdict needs a list of reasons, has {told_by!r:.40}")
    if not isinstance(word, str):
        raise SceneError(f"the word on a verdict is a text, not {word!r:.40}")
    told = document.get("probability")
    if told is not None and not (isinstance(told, (int, float)) and 0 <= told <= 1):
        raise SceneError(f"the probability of a verdict is between 0 and 1, not {told!r:.40}")
    standing, gone = (tuple(_from(r) for r in some) for some in (rows or [], overruled))
    verdict = Verdict(standing, None if told is None else float(told), word, gone)
    if verdict.level != level:
        raise SceneError(f"the verdict {level!r} has reasons that make it {verdict.level!r}")
    return verdict


def _reason(reason: Reason) -> dict[str, Any]:
    return {
        "type": reason.type,
        "level": reason.level,
        "kind": reason.kind,
        "values": reason.numbers,
        "text": reason.text,
        "help": reason.help,
    }


def _from(row: Mapping[str, Any]) -> Reason:
    if not isinstance(row.get("text"), str):
        raise SceneError(f"a reason of a verdict needs a text, has {row.get('text')!r:.40}")
    kind, help_ = str(row.get("kind", row.get("type", ""))), str(row.get("help", ""))
    return Reason(str(row.get("type")), kind, row.get("values", {}), row["text"], help_, row.get("level"))  # type: ignore[arg-type]
