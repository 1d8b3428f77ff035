"""Objects of twin.json with their path: every error names the file, the field and its value."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from twin.errors import InputError, SceneError
from twin.quantities import LARGEST

T = TypeVar("T")


def leaves(value: Any) -> Iterator[Any]:
    """What a list of lists holds."""
    for v in value:
        if isinstance(v, list):
            yield from leaves(v)
        else:
            yield v


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class Node:
    """One object of the document with the path that leads to it."""

    def __init__(self, file: Path, path: str, value: Any) -> None:
        self.file, self.path, self.value = file, path, value
        if not isinstance(value, dict):
            raise self.error(f"must be an object, is {value!r:.60}")

    def error(self, problem: str, key: str = "") -> InputError:
        where = ".".join(x for x in (self.path, key) if x) or "document"
        return InputError(f"{self.file}: {where} {problem}", "see docs/twin_format.md")

    def raw(self, key: str) -> Any:
        if key not in self.value:
            raise self.error("is missing", key)
        return self.value[key]

    def child(self, key: str) -> Node:
        return Node(self.file, f"{self.path}.{key}".lstrip("."), self.raw(key))

    def maybe(self, key: str, read: Callable[[Node], T]) -> T | None:
        return None if self.value.get(key) is None else read(self.child(key))

    def children(self, key: str) -> list[Node]:
        rows = self.list(key)
        return [Node(self.file, f"{self.path}.{key}[{k}]".lstrip("."), v) for k, v in enumerate(rows)]

    def list(self, key: str) -> list[Any]:
        value = self.raw(key)
        if not isinstance(value, list):
            raise self.error(f"must be a list, is {value!r:.60}", key)
        return value

    def text(self, key: str) -> str:
        value = self.raw(key)
        if not isinstance(value, str):
            raise self.error(f"must be a text, is {value!r:.60}", key)
        return value

    def number(self, key: str) -> float:
        value = self.raw(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"must be a number, is {value!r:.60}", key)
        if not abs(value) < np.inf or abs(value) > LARGEST:
            raise self.error(f"must be a number within ±{LARGEST:g}, is {value!r:.20}", key)
        return float(value)

    def integer(self, key: str) -> int:
        value = self.raw(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(f"must be a whole number, is {value!r:.60}", key)
        return value

    def array(self, key: str, shape: tuple[int | None, ...], whole: bool = False) -> Any:
        value = self.list(key)
        try:
            if not all(map(is_number, leaves(value))):
                raise ValueError
            a = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError, RecursionError):
            raise self.error(f"must hold numbers only, is {value!r:.60}", key) from None
        if not value and shape[0] is None:
            a = np.zeros((0, *(s or 0 for s in shape[1:])))
        if a.ndim != len(shape) or any(s is not None and s != n for s, n in zip(shape, a.shape, strict=True)):
            raise self.error(f"must have shape {shape}, has {a.shape}", key)
        if whole and (not np.all(np.abs(a) <= LARGEST) or np.any(a != np.floor(a))):
            raise self.error(f"must hold whole numbers within ±{LARGEST:g}", key)
        return a.astype(np.int64) if whole else a

    @contextmanager
    def building(self) -> Iterator[None]:
        """Say where in the document a law of a type is broken."""
        try:
            yield
        except SceneError as e:
            raise InputError(f"{self.file}: {self.path or 'document'}: {e.problem}", e.remedy) from e
