"""The page of a run in the browser of this machine's user, who edits the twin in it."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from twin import edits
from twin.errors import InputError
from twin.page.page import gathered, text_of, written
from twin.report.sections import PAGE
from twin.runs.run_lock import claimed
from twin.storage import load
from twin.view.local import HTML, JSON, Act, Answer, LocalServer, answering
from twin.view.pixel import pixel_of
from twin.view.work import Work

_WORD = re.compile(
    r"(--at \d+,\d+@\d+|--interval \d+:\d+)( --interval \d+:\d+)?( --type (hinge|slide))?", re.ASCII
)
_WAITING = (
    '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="2"><title>Funtwin</title>'
    "<p>The recording is reconstructed again; the page comes when that is done.</p>"
)


class Server(LocalServer):
    """Serves `run`, one edit at a time.

    Raises InputError for a folder without a twin, and as `LocalServer`.
    """

    def __init__(self, run: Path, port: int = 0) -> None:
        if not (run / "twin" / "twin.json").is_file():
            raise InputError(f"{run} holds no twin/twin.json", "give the run folder")
        self.run, self.writing, self.work = run, threading.Lock(), Work(run)
        self._made: tuple[_Files, str] | None = None
        super().__init__(port)

    def page(self, path: str) -> Answer | None:
        """The page, and how far a reconstruction is."""
        if path == "work":
            return Answer(json.dumps(self.work.state).encode(), JSON)
        if path:
            return None
        if self.work.going_on:
            return Answer(_WAITING.encode(), HTML)
        with self.writing, claimed(self.run):
            if self._made is None or self._made[0] != _files(self.run):
                self._make()
            assert self._made is not None
            return Answer(self._made[1].encode(), HTML)

    def _make(self) -> Mapping[str, Any]:
        """Gather what the run shows, and keep the live page of it while no file of the run changes."""
        told = gathered(self.run)
        self._made = (_files(self.run), text_of(told, live=True))
        return told

    @property
    def acts(self) -> Mapping[str, Act]:
        """An edit, its undoing, and a word on the recording."""
        return {name: partial(self._act, act) for name, act in _ACTS.items()}

    def _act(self, act: _Act, body: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to an act, after which the page is written anew or the recording reconstructed."""
        with self.writing:
            self.work.require_idle()
            with claimed(self.run):
                told = act(self.run, body)
                again = told.pop("again", None)
                if again is None:
                    written(self.run, self._make())
            if again is None:
                return told
            self.work.begin(again)  # the other process claims the run
            return {**told, "working": True}

    def end(self) -> None:
        """End a reconstruction that goes on."""
        self.work.end()


@contextmanager
def serving(run: Path, port: int = 0) -> Iterator[Server]:
    """A server of the run, answering until the end."""
    with answering(Server(run, port)) as server:
        yield server


_Files = dict[Path, tuple[int, int, int]]


def _files(run: Path) -> _Files:
    """When each file of a run was written that a page can show, with its size and number: all but the page
    itself, the intermediate results and what is hidden."""
    found = {}
    for folder in (f for f in run.iterdir() if f.name not in (PAGE, "stages") and not f.name.startswith(".")):
        for path in folder.rglob("*") if folder.is_dir() else [folder]:
            with suppress(FileNotFoundError):  # it was there for a moment
                told = path.stat()
                found[path] = (told.st_mtime_ns, told.st_size, told.st_ino)
    return found


_Act = Callable[[Path, Mapping[str, Any]], dict[str, Any]]


def _edit(run: Path, told: Mapping[str, Any]) -> dict[str, Any]:
    edit = edits.edit_of(load(run), told.get("part", ""), told.get("edit", ""), told.get("why", ""))
    return {"edit": edit.row, "warnings": edits.add(run, [edit]).warnings}


def _undo(run: Path, _: Mapping[str, Any]) -> dict[str, Any]:
    """A word on the recording is taken back by another reconstruction."""
    undone, made = edits.undo(run)
    again = {"again": ""} if any(e.what == edits.SAID for e in undone) else {}
    return {"undone": [e.row for e in undone], "warnings": made.warnings, **again}


def _say(run: Path, told: Mapping[str, Any]) -> dict[str, Any]:
    """A word on a part: at a pixel of a frame, in which frames it moves, its type; or, of a part that was
    found, its type alone."""
    word = told.get("word", "")
    if told.get("part"):
        word = f"--at {pixel_of(load(run), told['part'])} {word}"
    if not _WORD.fullmatch(word):
        raise InputError(f"{word!r:.80} says nothing of a part", "point at it in the picture")
    return {"again": word}


_ACTS: Mapping[str, _Act] = {"edit": _edit, "undo": _undo, "say": _say}
