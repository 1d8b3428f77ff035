"""How a stage reports a loop's progress without printing: it wraps the loop in a function it is given."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

T = TypeVar("T")


class Loop(Protocol):
    """Wraps an iterable; `what` names the work."""

    def __call__(self, items: Iterable[T], what: str) -> Iterable[T]: ...


def untold(items: Iterable[T], what: str) -> Iterable[T]:  # noqa: ARG001  (shares the protocol's signature)
    """Tells nobody."""
    return items
