"""Warnings that a stage gives, collected."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def recording_warnings(compute: Callable[[], T]) -> tuple[T, list[str]]:
    """Call `compute`; UserWarnings are collected, each text once, and other warnings shown as usual."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        value = compute()
    notes: list[str] = []
    for w in caught:
        if issubclass(w.category, UserWarning):
            notes += [] if str(w.message) in notes else [str(w.message)]
        else:
            warnings.warn_explicit(w.message, w.category, w.filename, w.lineno)
    return value, notes
