"""Answers kept on disk: the same question to the same model is asked once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from twin.files.text import read_json, write_json
from twin.vlm.client import DEFAULT, Endpoint, Limits, Question, ask

T = TypeVar("T")
_VERSION = 1


@dataclass(frozen=True)
class Answer(Generic[T]):
    """What was read from an answer, and whether it was on disk already."""

    value: T
    cached: bool


def question_key(question: Question, endpoint: Endpoint) -> str:
    """SHA-256 over pictures, texts, model and address."""
    pictures = [hashlib.sha256(p).hexdigest() for p in question.pictures]
    parts = [_VERSION, pictures, question.instructions, question.text, endpoint.model, endpoint.url]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def ask_once(
    question: Question,
    endpoint: Endpoint,
    read: Callable[[str], T],
    folder: Path | None = None,
    refresh: bool = False,
    limits: Limits = DEFAULT,
) -> Answer[T]:
    """The answer as `read` understands it, from `folder` when it was asked before.

    Only an answer that `read` accepts is kept, with the question's texts and its model, never with the key.

    Args:
        read: turns the text into a value; raises ServiceError for a text that it can't use.
        refresh: ask again and replace what is kept.
    """
    path = None if folder is None else folder / f"{question_key(question, endpoint)}.json"
    kept = read_json(path).get("answer") if path is not None and not refresh else None
    if isinstance(kept, str):
        return Answer(read(kept), cached=True)
    text = ask(question, endpoint, limits)
    value = read(text)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        record = {
            "version": _VERSION,
            "model": endpoint.model,
            "endpoint": endpoint.place,
            "instructions": question.instructions,
            "question": question.text,
            "pictures": [hashlib.sha256(p).hexdigest() for p in question.pictures],
            "answer": text,
        }
        write_json(path, record)
    return Answer(value, cached=False)
