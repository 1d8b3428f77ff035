"""Edits of verdicts: what the user holds for right in spite of the reasons."""

from __future__ import annotations

from dataclasses import replace

from twin.edits.unfit import Unfit
from twin.placed import replaced
from twin.scene import Part, Twin
from twin.verdict import Verdict, of_twin


def overruled(twin: Twin, part: Part | None, word: str) -> Twin:
    """The part, or the twin as a whole with all its parts where it is None, trusted by the user's word."""
    if twin.verdict is None:
        raise Unfit("it has no verdict: nothing is doubted")
    if part is not None:
        return rejudged(_by_word(twin, part, word))
    for one in twin.parts:
        twin = _by_word(twin, one, word) if one.verdict is not None and one.verdict.reasons else twin
    judged = rejudged(twin)
    assert judged.verdict is not None
    return replace(judged, verdict=judged.verdict.by_word(word)) if judged.verdict.reasons else judged


def _by_word(twin: Twin, part: Part, word: str) -> Twin:
    verdict = part.verdict if part.verdict is not None else Verdict()
    return replaced(twin, replace(part, verdict=verdict.by_word(word)))


def rejudged(twin: Twin) -> Twin:
    """With the verdict that its parts, by their names now, and the reasons against all of it make."""
    if twin.verdict is None:
        return twin
    own = [r for r in twin.verdict.reasons if r.type != "OfPart" or not r.numbers["written"]]
    fresh = of_twin({p.name: p.verdict for p in twin.parts if p.verdict is not None}, own=own)
    gone = twin.verdict.overruled
    return replace(
        twin, verdict=replace(fresh, word=twin.verdict.word if gone else fresh.word, overruled=gone)
    )
