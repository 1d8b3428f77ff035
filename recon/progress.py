"""How a stage tells its progress without printing: it wraps its loop in a function that the caller hands in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

T = TypeVar("T")


class Progress(Protocol):
    """Wraps an iterable; `what` names the work."""

    def __call__(self, items: Iterable[T], what: str) -> Iterable[T]: ...


def silent(items: Iterable[T], what: str) -> Iterable[T]:  # noqa: ARG001  (shares the protocol's signature)
    """Progress that shows nothing."""
    return items
