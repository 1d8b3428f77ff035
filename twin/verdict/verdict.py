"""What a part or a twin is worth, by the reasons against it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from twin.errors import SceneError
from twin.verdict.reason import Level, Reason, worst
from twin.verdict.reasons import reason


@dataclass(frozen=True)
class Verdict:
    """The reasons against a part or a twin, none if trusted. Its level is that of the worst of them.

    probability: that a part is right, where it was told by calibrated evidence; None of a twin. word: why
    the user holds it for right all the same, in one line, empty without that. overruled: the reasons that
    the word took away.
    """

    reasons: tuple[Reason, ...] = ()
    probability: float | None = None
    word: str = ""
    overruled: tuple[Reason, ...] = ()

    def __post_init__(self) -> None:
        if self.overruled and not self.word:
            raise SceneError("reasons are overruled by a word alone, and there is none")
        if self.word and not self.word.isprintable():
            raise SceneError(f"a word on a verdict is one line of text, got {self.word!r:.60}")

    @property
    def level(self) -> Level:
        """`trusted` without a reason, else the worst that one of them says."""
        return worst(r.level for r in self.reasons)

    @property
    def trusted(self) -> bool:
        return not self.reasons

    @property
    def main(self) -> Reason | None:
        """The first of the worst reasons; None of what is trusted."""
        return next((r for r in self.reasons if r.level == self.level), None)

    @property
    def of_all(self) -> Verdict:
        """Of a twin's verdict, the reasons against all of it: its cameras, up, recording."""
        return Verdict(tuple(r for r in self.reasons if r.type != "OfPart"))

    def by_word(self, word: str) -> Verdict:
        """The same, with no reason left by the user's word, which says why."""
        return Verdict((), self.probability, word, (*self.overruled, *self.reasons))

    @property
    def text(self) -> str:
        """One line: the level, the main reason with what helps, and how many more there are."""
        whose = f", by the user's word: {self.word}" if self.word else ""
        if self.main is None:
            return f"{self.level}{whose}"
        more = len(self.reasons) - 1
        rest = f" (and {more} more reason{'s' * (more != 1)})" if more else ""
        return f"{self.level}: {self.main.text}; {self.main.help}{rest}{whose}"


def of_twin(
    written: Mapping[str, Verdict], refused: Mapping[str, Verdict] | None = None, own: Sequence[Reason] = ()
) -> Verdict:
    """A twin's verdict: its own reasons, then those against each part by its name.

    refused: parts that the twin leaves out. They make it refused where it has no other, else doubtful: what
    is written may well be right, but it is not all that moved.
    """
    against = list(own)
    words = [f"{name}: {verdict.word}" for name, verdict in written.items() if verdict.word]
    for name, verdict in written.items():
        against += [_of_part(name, True, r, r.level) for r in verdict.reasons]
    for name, verdict in (refused or {}).items():
        level: Level = "doubtful" if written else "refused"
        against += [_of_part(name, False, r, level) for r in verdict.reasons if r.level == "refused"]
    return Verdict(tuple(against), word="; ".join(words))


def _of_part(name: str, written: bool, told: Reason, level: Level) -> Reason:
    return reason("OfPart", level, name, written, told.type, told.text, told.kind, told.help)
