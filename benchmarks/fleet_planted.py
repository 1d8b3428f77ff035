"""Faults planted among real recordings of a batch: how each is told, what is lost, what a retry does.

Recordings are copied under names of their own: some without a fault, one with a PNG cut in half, one with a
pipe in place of a PNG, one whose process is killed, and one whose process is stopped, so that it hangs. The
batch is ended twice while it works, by SIGTERM and by SIGKILL, and begun again. One more is given less
memory than it needs, and one a small disk that is filled while it works.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from twin.batch.batch import RUN_MB
from twin.batch.journal import JOURNAL, latest

_LITTLE_GB, _DISK_MB = 0.3, 600
_NEVER = "never met"
_PLANTED = {
    "poisoned": "a PNG cut in half", "pipe": "a pipe for a PNG", "killed": "the unit's process killed",
    "stopped": "the unit's process stopped for good",
}  # fmt: skip
_SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP}


def copied(recording: Path, name: str, place: Path) -> Path:
    """The recording under another name."""
    shutil.copytree(recording, place / name)
    return place / name


def a_picture(recording: Path) -> Path:
    """The middle one of those that a reconstruction reads."""
    pictures = [p for p in sorted(recording.rglob("*.png")) if "truth" not in p.relative_to(recording).parts]
    return pictures[len(pictures) // 2]


def poison(recording: Path) -> None:
    """Cut a picture off in its middle."""
    picture = a_picture(recording)
    data = picture.read_bytes()
    picture.unlink()
    picture.write_bytes(data[: len(data) // 2])


def no_picture(recording: Path) -> None:
    """Put a pipe, which nobody writes to, in the place of a picture."""
    picture = a_picture(recording)
    picture.unlink()
    os.mkfifo(picture)


def batch(given: Path, out: Path, *words: str, **how: Any) -> subprocess.Popen[bytes]:
    """`twin batch` of all recordings in a folder."""
    command = [
        sys.executable,
        "-m",
        "twin",
        "batch",
        f"{given}/*",
        "-o",
        str(out),
        "--do",
        "reconstruct",
        *words,
    ]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **how)


def rows(out: Path) -> dict[str, dict[str, Any]]:
    """Last rows by the name of the recording."""
    return {Path(r["recording"]).name: r for r in latest(out).values()}


def good(out: Path) -> set[str]:
    return {name for name, row in rows(out).items() if row["exit"] in (0, 2)}


def twin_of(out: Path, name: str) -> dict[str, bytes]:
    """The files of a twin, without what tells its name and when it was made."""
    twin = out / "runs" / rows(out)[name]["id"] / "twin"
    files = {str(p.relative_to(twin)): p.read_bytes() for p in sorted(twin.rglob("*")) if p.is_file()}
    told = json.loads(files.pop("twin.json"))
    for own in ("provenance", "name", "recording"):
        told.pop(own, None)
    return files | {"twin.json": json.dumps(told, sort_keys=True).encode()}


def when(out: Path, name: str, told: Callable[[Path], bool], process: subprocess.Popen[bytes]) -> Path | None:
    """Wait until the run of a unit is so far and return it; None if the batch ended before."""
    while process.poll() is None:
        for run in (out / "runs").glob(f"{name}_*"):
            if told(run):
                return run
        time.sleep(0.2)
    return None


def stages(count: int) -> Callable[[Path], bool]:
    return lambda run: len(list(run.glob("stages/*/stage.json"))) >= count


def retried(given: Path, out: Path, *words: str) -> str:
    """What `--retry failed` does: the names that got another line, and how they end."""
    before = len((out / JOURNAL).read_text().splitlines())
    batch(given, out, "--retry", "failed", *words).wait()
    again = [json.loads(line) for line in (out / JOURNAL).read_text().splitlines()[before:]]
    told = [f"{Path(r['recording']).name} ({'fails again' if r['exit'] == 1 else 'done'})" for r in again]
    return ", ".join(sorted(told)) or "nothing"


def said(out: Path, name: str) -> str:
    """The line in which a unit's failure is told."""
    return str(rows(out)[name]["error"]).replace(str(out), "DIR")


def process_of(out: Path, name: str) -> int | None:
    """The process that reconstructs a unit, once two stages of it are done."""
    for run in (out / "runs").glob(f"{name}_*"):
        for place in Path("/proc").iterdir() if stages(2)(run) else []:
            with suppress(OSError, ValueError):
                words = (place / "cmdline").read_bytes().split(b"\0")
                if b"reconstruct" in words and os.fsencode(run) in words:
                    return int(place.name)
    return None


def signalled(out: Path, wanted: dict[str, signal.Signals], process: subprocess.Popen[bytes]) -> set[str]:
    """Send each unit's process its signal while it works; the names of those that were met."""
    met: set[str] = set()
    while process.poll() is None:
        for name in wanted.keys() - met:
            number = process_of(out, name)
            if number is not None:
                os.kill(number, wanted[name])
                met.add(name)
        time.sleep(0.5)
    return met


def ended_driver(
    given: Path, out: Path, number: signal.Signals, far: Callable[[], bool], words: Sequence[str]
) -> list[Any]:
    """End the batch when it is so far; how that is told, and how much was done before and is not after."""
    process = batch(given, out, *words)
    while process.poll() is None and not far():
        time.sleep(0.2)
    if process.poll() is not None:
        return [_NEVER, "-"]
    before = good(out)
    process.send_signal(number)
    process.wait()
    return ["goes on by the same command", len(before - good(out))]


def among_others(
    recordings: Sequence[Path], place: Path, whole: dict[str, bytes], words: Sequence[str]
) -> list[list[Any]]:
    """Rows of the table for the faults that one batch can hold."""
    given, out = place / "recordings", place / "out"
    for k, recording in enumerate(recordings):
        copied(recording, f"good_{k}", given)
    first = recordings[0]
    poison(copied(first, "poisoned", given))
    no_picture(copied(first, "pipe", given))
    for name in _SIGNALS:
        copied(first, name, given)
    moments = [
        (
            signal.SIGTERM,
            "with two stages done",
            lambda: any(map(stages(2), (out / "runs").glob("good_0_*"))),
        ),
        (signal.SIGKILL, "with a recording done", lambda: bool(good(out))),
    ]
    ended = [
        [f"the batch ended by {s.name} {moment}", *ended_driver(given, out, s, far, words), "-"]
        for s, moment, far in moments
    ]
    process = batch(given, out, *words)
    met = signalled(out, _SIGNALS, process)
    told, before = {name: said(out, name) for name in _PLANTED}, good(out)
    again = retried(given, out, *words)
    gone = len(before - good(out)) + others(out, ("good_0", *_SIGNALS), whole)
    table = [
        [what, told[name] if name in met or name not in _SIGNALS else _NEVER, gone, "as the first row"]
        for name, what in _PLANTED.items()
    ]
    table[0][-1] = again
    return table + ended


def others(out: Path, names: Sequence[str], whole: dict[str, bytes]) -> int:
    """How many of these are not done, or other than the twin of a batch left alone."""
    return sum(n not in good(out) or twin_of(out, n) != whole for n in names)


def too_little_memory(
    recording: Path, place: Path, whole: dict[str, bytes], words: Sequence[str]
) -> list[Any]:
    given, out = place / "recordings", place / "out"
    copied(recording, "eats", given)
    batch(given, out, "--memory", str(_LITTLE_GB), *words).wait()
    told = said(out, "eats")
    again = retried(given, out, *words)
    return [f"`--memory {_LITTLE_GB}`", told, others(out, ("eats",), whole), again]


def small_disk(recording: Path, place: Path, words: Sequence[str]) -> tuple[list[Any], dict[str, bytes]]:
    """A disk that another program fills while the second unit works, and the twin of the first one, which is
    left alone. Where no disk can be mounted, the first one alone is done."""
    what = f"a disk of {_DISK_MB} MB filled while it works"
    given, disk = place / "recordings", place / "disk"
    disk.mkdir(parents=True)
    out, filling, one = disk / "out", disk / "filling", ["--workers", "1", *words]
    copied(recording, "a_good", given)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_DISK_MB}m", "none", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        batch(given, out, *one).wait()
        return [what, "not tried: no disk can be mounted here", "-", "-"], twin_of(out, "a_good")
    try:
        copied(recording, "full", given)
        process = batch(given, out, *one)
        met = when(out, "full", stages(2), process)
        with suppress(OSError), filling.open("wb", buffering=0) as file:
            while met and file.write(bytes(2**16)):
                pass
        process.wait()
        told = (said(out, "full") if "full" in rows(out) else "not begun") if met else _NEVER
        whole = twin_of(out, "a_good")
        filling.unlink()
        again = retried(given, out, *one)
        return [what, told, others(out, ("a_good", "full"), whole), again], whole
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def tried(recordings: Sequence[Path], place: Path, options: Namespace) -> dict[str, Any]:
    """All of it; figures for the page."""
    assert 2 * RUN_MB < _DISK_MB
    shutil.rmtree(place, ignore_errors=True)
    words = ["--timeout", str(options.timeout)]
    many = ["--workers", str(options.workers), *words]
    full, whole = small_disk(recordings[0], place / "full", words)
    print(full, flush=True)
    table = among_others(recordings, place / "among", whole, many)
    print(*table, sep="\n", flush=True)
    table += [too_little_memory(recordings[0], place / "memory", whole, many), full]
    print(table[-2], flush=True)
    told = {"recordings": [r.name for r in recordings], "workers": options.workers, "of": len(recordings)}
    return {**told, "rows": table}
