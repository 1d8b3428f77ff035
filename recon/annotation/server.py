"""The page in which a person annotates a recording, in the browser of this machine's user."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2

from recon.annotation.marks import Mark, Marks, marks_of, read_marks, write_marks
from recon.annotation.overlay import overlay
from recon.annotation.seen import Seen
from recon.annotation.solve import Annotated, annotated
from recon.annotation.truth_folder import write_truth
from twin.errors import InputError
from twin.runs.run_lock import claimed
from twin.view.local import HTML, JPEG, JSON, Act, Answer, LocalServer, answering

_HERE = Path(__file__).parent
_FRAME = re.compile(r"frame/(\d{1,7})", re.ASCII)
_QUALITY = 90


class Server(LocalServer):
    """Serves one recording and the marks on it, which `folder` keeps in annotation.json; the truth goes to
    truth/ there."""

    def __init__(self, seen: Seen, folder: Path, port: int = 0) -> None:
        self.seen, self.file, self.truth = seen, folder / "annotation.json", folder / "truth"
        self.marks = read_marks(self.file, seen.recording)
        self.writing = threading.Lock()
        super().__init__(port)

    def page(self, path: str) -> Answer | None:
        """The page, the marks, and the frames' pictures."""
        if path == "":
            script = (_HERE / "annotate.js").read_text(encoding="utf-8")
            text = (_HERE / "page.html").read_text(encoding="utf-8").replace("/* annotate.js */", script)
            return Answer(text.encode(), HTML)
        if path == "marks":
            self.marks = read_marks(self.file, self.seen.recording)
            return Answer(json.dumps(self.state).encode(), JSON)
        match = _FRAME.fullmatch(path)
        if match is None or int(match[1]) >= len(self.seen.recording):
            return None
        image = cv2.cvtColor(self.seen.recording.color(int(match[1])), cv2.COLOR_RGB2BGR)
        return Answer(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes(), JPEG)

    @property
    def acts(self) -> Mapping[str, Act]:
        """A mark, the last one taken back, the joint of a part, the truth."""
        return {"mark": self._mark, "undo": self._undo, "solve": self._solve, "write": self._write}

    @property
    def state(self) -> dict[str, Any]:
        """JSON types: the recording's size and all marks."""
        recording = self.seen.recording
        return {
            "name": recording.name,
            "frames": len(recording),
            "times": [round(float(t - recording.times[0]), 4) for t in recording.times],
            "size": [recording.intrinsics.width, recording.intrinsics.height],
            "marks": [m.row for m in self.marks.rows],
        }

    def _mark(self, told: Mapping[str, Any]) -> dict[str, Any]:
        mark = Mark(told.get("part", ""), told.get("what", ""), told.get("value", ""))
        return self._keep([*self.marks.rows, mark])

    def _undo(self, _: Mapping[str, Any]) -> dict[str, Any]:
        if not self.marks.rows:
            raise InputError("there is no mark to take back", "make one first")
        return self._keep(list(self.marks.rows[:-1]))

    def _keep(self, rows: list[Mark]) -> dict[str, Any]:
        marks = marks_of(rows, self.seen.recording)
        with self._writing():
            write_marks(self.file, marks, self.seen.recording)
            self.marks = marks
        return {"marks": [m.row for m in marks.rows]}

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """The folder for this process alone. Raises InputError where another one works on it or did so."""
        with self.writing, claimed(self.file.parent):
            if read_marks(self.file, self.seen.recording).rows != self.marks.rows:
                raise InputError("another page made marks meanwhile", "reload this one")
            yield

    def _solve(self, told: Mapping[str, Any]) -> dict[str, Any]:
        for part in self.marks.parts:
            if part.name == told.get("part"):
                return overlay(self.seen, annotated(self.seen, part))
        raise InputError(f"there is no part {told.get('part', '')!r:.60}", "add it first")

    def _write(self, _: Mapping[str, Any]) -> dict[str, Any]:
        with self._writing():
            parts = solved(self.seen, self.marks)
            folder = write_truth(self.truth, self.seen, self.marks, parts)
        return {"truth": str(folder), "notes": [f"{p.marks.name}: {n}" for p in parts for n in p.notes]}


def solved(seen: Seen, marks: Marks) -> list[Annotated]:
    """All parts that are marked."""
    return [annotated(seen, part) for part in marks.parts]


@contextmanager
def annotating(seen: Seen, folder: Path, port: int = 0) -> Iterator[Server]:
    """A server of the recording, answering until the end."""
    with answering(Server(seen, folder, port)) as server:
        yield server


def seen_in(run: Path, recording: Any) -> Seen:
    """What a run found of its recording's cameras and corners.

    Raises InputError for a run that did not come so far.
    """
    from recon.pipeline import read_stage
    from twin.storage import load

    cameras = load(run).cameras if (run / "twin" / "twin.json").is_file() else None
    return Seen(
        recording, read_stage(run, "tracks"), cameras or read_stage(run, "path"), read_stage(run, "noise")
    )
