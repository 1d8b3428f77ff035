"""Every verb, ended at random moments or on a disk that is full or may not be written: nothing of the user's
is lost, no file is torn, and the same command works again. benchmarks/interrupts.py ends them a hundred
times."""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from benchmarks import interrupt_cases as cases
from benchmarks.interrupts import reference, trial

WRITING = ("reconstruct", "import", "export", "check", "replay", "trajectory", "evaluate", "physics")


@pytest.fixture(scope="session")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the shipped recording."""
    folder = tmp_path_factory.mktemp("interrupted")
    cases.make_base(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("case", cases.CASES, ids=[c.verb for c in cases.CASES])
def test_a_verb_that_is_ended_at_a_random_moment_loses_nothing(
    base: Path, tmp_path: Path, case: cases.Case
) -> None:
    told = reference(base, tmp_path, case)
    ended = [trial(base, tmp_path, case, told, k, seed=7) for k in range(2)]  # one SIGINT, one SIGKILL
    assert not [t for t in ended if t.faults]


def limited(size: int) -> Callable[[], None]:
    """No file may grow beyond `size` bytes: what a full disk is to a writer."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def bound() -> None:
    """Permissions bind this process, root's too: it gives up CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH."""
    for capability in (1, 2):
        ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP


def folders(place: Path) -> Iterator[Path]:
    yield place
    for path in place.rglob("*"):
        if path.is_dir() and not path.is_symlink():
            yield path


def ready(base: Path, place: Path, verb: str) -> cases.Case:
    """A place in which the verb has something to write."""
    case = next(c for c in cases.CASES if c.verb == verb)
    cases.make_place(base, place, replace(case, prepare=lambda _place, _rng: 1.0), Random(0))  # noqa: S311
    if verb == "reconstruct":
        shutil.rmtree(place / "run/twin")
        (contact,) = (place / "run/stages").glob("*_contact")
        shutil.rmtree(contact)
    return case


def judged(case: cases.Case, place: Path, said: tuple[int, str], mine: dict, before: dict) -> None:
    """One line that tells it or all well; nothing lost, nothing torn, nothing left."""
    code, err = said
    assert not [t for t in cases.TELLTALES if t in err], err
    lines = [x for x in err.splitlines() if x.startswith("twin: ")]
    assert (code, len(lines)) in ((0, 0), (1, 1)), err
    assert not cases.harm(place, before, mine)
    assert not cases.leftovers(place, mine)
    assert not list((place / "tmp").iterdir())


def again(case: cases.Case, place: Path) -> None:
    process = cases.start(case.verb, case.arguments, place)
    _, err = process.communicate()
    assert process.returncode == 0 or (case.once and case.once in err), err


@pytest.mark.slow
@pytest.mark.parametrize("size", [1_000, 100_000, 1_000_000])
@pytest.mark.parametrize("verb", WRITING)
def test_a_full_disk_is_told_in_one_line_and_loses_nothing(
    base: Path, tmp_path: Path, verb: str, size: int
) -> None:
    case = ready(base, tmp_path, verb)
    before, mine = cases.state(tmp_path), cases.of_user(tmp_path)
    process = cases.start(verb, case.arguments, tmp_path, limited(size))
    _, err = process.communicate()
    judged(case, tmp_path, (process.returncode, err), mine, before)
    assert process.returncode == 1 or size > 1_000
    again(case, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "folder", ["run", "run/twin", "run/export/mjcf", "run/replay/franka", "run/stages", "mine/out", "tmp"]
)
@pytest.mark.parametrize("verb", WRITING)
def test_a_folder_that_may_not_be_written_is_told_in_one_line_and_loses_nothing(
    base: Path, tmp_path: Path, verb: str, folder: str
) -> None:
    if sys.platform != "linux" and os.geteuid() == 0:
        pytest.skip("root may write everywhere, and can give that up on Linux only")
    case = ready(base, tmp_path, verb)
    if not (tmp_path / folder).is_dir():
        pytest.skip(f"{verb} starts without {folder}")
    before, mine = cases.state(tmp_path), cases.of_user(tmp_path)
    locked = list(folders(tmp_path / folder))
    for path in locked:
        path.chmod(0o555)
    process = cases.start(verb, case.arguments, tmp_path, bound)
    _, err = process.communicate()
    assert all(path.stat().st_mode & 0o777 == 0o555 for path in locked)  # nobody unlocks a user's folder
    for path in locked:
        path.chmod(0o755)
    judged(case, tmp_path, (process.returncode, err), mine, before)
    again(case, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["simulate", *WRITING])
def test_a_file_in_place_of_a_folder_is_told_in_one_line(base: Path, tmp_path: Path, verb: str) -> None:
    case = ready(base, tmp_path, verb)
    (tmp_path / "afile").write_text("of the user: a file")
    before, mine = cases.state(tmp_path), cases.of_user(tmp_path)
    for wrong in ("afile", "afile/run"):
        arguments = [wrong if a in ("run", "out", "new", "mine/out") else a for a in case.arguments]
        process = cases.start(verb, arguments, tmp_path)
        _, err = process.communicate()
        judged(case, tmp_path, (process.returncode, err), mine, before)
        assert process.returncode == 1
