"""What is known about each twin: legal, illegal or open, and the words in which a verb must speak of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from tests.makers.twin.hand_made.drafts import Draft, cupboard

Verdict = Literal["legal", "illegal", "open"]
Words = tuple[str, ...]
Change = Callable[[Draft], None]


@dataclass(frozen=True)
class Case:
    """A twin and what the verbs must make of it.

    refused: words of the one line with which an illegal one, or an open one, is refused. warned: words that
    `export` or `check` must say about a legal one, or about an open one that is not refused. cause, faults:
    words of the true cause with which `check` and `lint` end with 2; none where they must be content.
    doubted: words of lint's warnings, with which it ends with 0.
    """

    name: str
    verdict: Verdict
    build: Callable[[], Draft]
    refused: Words = ()
    warned: Words = ()
    cause: Words = ()
    faults: Words = ()
    doubted: Words = ()

    @property
    def id(self) -> str:
        return self.name.replace(" ", "-")


class Cases(list[Case]):
    """Twins of one verdict in the order in which they are written; each starts from the cupboard unless it
    says otherwise."""

    def __init__(self, verdict: Verdict) -> None:
        super().__init__()
        self.verdict = verdict

    def add(
        self,
        name: str,
        base: Callable[[], Draft] = cupboard,
        refused: Words = (),
        warned: Words = (),
        cause: Words = (),
        faults: Words = (),
        doubted: Words = (),
    ) -> Callable[[Change], Change]:
        """Register a change of `base()`."""

        def register(change: Change) -> Change:
            def build() -> Draft:
                draft = base()
                change(draft)
                return draft

            self.append(Case(name, self.verdict, build, refused, warned, cause, faults, doubted))
            return change

        return register
