"""A batch on a small disk that gets full: what meets it is told, nothing that ended is lost, it goes on."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.twin.batch.test_batch import STAND_IN, called, go, recordings
from twin.batch import Settings, work
from twin.batch.batch import State
from twin.batch.claims import Claims
from twin.batch.journal import JOURNAL, append, has_room, latest
from twin.batch.page import INDEX
from twin.cli import batch_verb
from twin.cli.main import run as twin_verb
from twin.errors import InputError
from twin.files import room


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 160 MB."""
    place = tmp_path / "disk"
    place.mkdir()
    told = mounted(place, "size=160m")
    if told:
        pytest.skip(f"needs a small disk, which can't be mounted here: {told}")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "calls"
    monkeypatch.setattr(work, "PROGRAM", (sys.executable, str(STAND_IN), str(path)))
    return path


def mounted(place: Path, options: str) -> str:
    """What `mount` says where it can't."""
    try:
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", options, "none", place], capture_output=True, text=True
        )
    except FileNotFoundError:
        return "no program mount"
    return done.stderr.strip()


def fill(place: Path) -> Path:
    """Fill a disk to its last page."""
    path = place / "filling"
    with suppress(OSError), path.open("wb", buffering=0) as file:
        while file.write(bytes(2**16)):
            pass
    assert os.statvfs(place).f_bavail == 0
    return path


def no_more_files(disk: Path) -> str:
    """Let a disk hold the files that it holds, and none besides."""
    told = os.statvfs(disk)
    return mounted(disk, f"remount,nr_inodes={told.f_files - told.f_ffree}")


def names(given: list[str]) -> list[str]:
    return [name.rpartition("_")[0] for name in given]


def test_what_meets_a_full_disk_is_told_and_done_when_there_is_room(
    tmp_path: Path, disk: Path, calls: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, out = recordings(tmp_path, "a", "fills", "late", "z"), disk / "out"
    command = ["batch", *given, "-o", str(out), "--workers", "2", "--do", "reconstruct"]
    assert twin_verb(command) == 1
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("batch ")]
    assert "\n".join(said) == (
        f"twin: the disk of {out} is full (0 MB left), 3 of 4 recordings are done; "
        "free some space and run again: what was computed is kept"
    )
    rows = {k.rpartition("_")[0]: r for k, r in latest(out).items()}
    full = f"reconstruct: the disk of {out} is full; free some space, then give --retry failed"
    assert {k: (r["exit"], r["error"]) for k, r in rows.items()} == {
        "a": (0, ""), "fills": (1, full), "late": (1, full),
    }  # fmt: skip
    assert not list((out / "claims").iterdir())
    assert mounted(disk, "remount,size=512m") == ""
    assert twin_verb(command) == 2
    assert names(called(calls, "reconstruct"))[3:] == ["z"]
    assert twin_verb([*command, "--retry", "failed"]) == 0
    assert sorted(names(called(calls, "reconstruct"))[4:]) == ["fills", "late"]
    assert len((out / JOURNAL).read_text().splitlines()) == 6
    whole = go(given, tmp_path / "whole", Settings(verbs=("reconstruct",), workers=2))
    for unit in whole.rows:
        twins = [place / "runs" / unit / "twin" / "twin.json" for place in (out, tmp_path / "whole")]
        assert twins[0].read_bytes() == twins[1].read_bytes()


def test_where_no_file_can_be_made_the_batch_ends_in_one_line(
    tmp_path: Path, disk: Path, calls: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["batch", *recordings(tmp_path, "a"), "-o", str(disk / "out")]
    append(disk, {"id": "b", "exit": 0})
    (disk / "out" / "claims").mkdir(parents=True)
    (disk / JOURNAL).rename(disk / "out" / JOURNAL)
    assert no_more_files(disk) == ""
    assert twin_verb(command) == 1
    assert f"twin: the disk of {disk / 'out'} is full (" in capsys.readouterr().err
    assert not calls.exists()


def test_a_unit_whose_log_can_not_be_made_is_told(
    tmp_path: Path, disk: Path, calls: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = Claims.take

    def taken_at_last(claims: Claims, unit: str) -> bool:
        taken = take(claims, unit)
        if unit.startswith("b"):
            assert no_more_files(disk) == ""
        return taken

    monkeypatch.setattr(Claims, "take", taken_at_last)
    with pytest.raises(InputError, match="2 of 3 recordings are done"):
        go(recordings(tmp_path, "a", "b", "c"), disk / "out", Settings(workers=1))
    a, b = latest(disk / "out").values()
    assert (a["exit"], b["exit"]) == (0, 1)
    assert "is full; free some space" in b["error"]


def test_a_line_for_which_there_is_no_room_leaves_the_journal_as_it_was(disk: Path) -> None:
    append(disk, {"id": "a", "exit": 0, "error": "x" * 3900})  # its page has room for a part of the next one
    before = (disk / JOURNAL).read_bytes()
    filling = fill(disk)
    with pytest.raises(OSError, match="No space") as told:
        append(disk, {"id": "b", "exit": 0, "error": "x" * 3900})
    assert (told.value.errno, told.value.filename) == (errno.ENOSPC, str(disk / JOURNAL))
    assert (disk / JOURNAL).read_bytes() == before
    filling.unlink()
    append(disk, {"id": "b", "exit": 1})
    assert [json.loads(line)["id"] for line in (disk / JOURNAL).read_text().splitlines()] == ["a", "b"]


def test_room_is_kept_on_a_disk_that_others_fill(disk: Path) -> None:
    append(disk, {"id": "a", "exit": 0})
    size = (disk / JOURNAL).stat().st_size
    assert has_room(disk, 2)
    assert (disk / JOURNAL).stat().st_size == size
    fill(disk)
    assert room.full(disk)
    assert not has_room(disk, 100)
    for unit in "bc":
        append(disk, {"id": unit, "exit": 0, "error": "x" * 15_000})
    assert list(latest(disk)) == ["a", "b", "c"]


def test_the_page_so_far_waits_for_room(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    so_far, state = batch_verb._PageSoFar(disk), State([], {}, {})
    now = [1000.0]
    monkeypatch.setattr(batch_verb.time, "monotonic", lambda: now[0])
    filling = fill(disk)
    so_far.write(state)
    assert not (disk / INDEX).exists()
    filling.unlink()
    now[0] += 1.0
    so_far.write(state)
    assert (disk / INDEX).is_file()
