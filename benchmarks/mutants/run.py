"""Plant the faults of the list, one at a time, and let the tests that can notice each judge it."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic
from typing import TypeVar

from benchmarks.mutants import testmap
from benchmarks.mutants.copies import Copy, tree_files
from benchmarks.mutants.draw import missing
from benchmarks.mutants.faults import Fault
from benchmarks.mutants.spots import Sources, Spot
from benchmarks.mutants.testmap import PACKAGES, FileMap

T = TypeVar("T")
NOTICED, SURVIVED, NOT_RUN = "noticed", "survived", "no test runs it"


@dataclass(frozen=True)
class Result:
    """How a fault fared. outcome: NOTICED, SURVIVED or NOT_RUN; by: the test that noticed it, or that the
    module can't be imported; tests: how many were run; judged: hash of the module and of the tests that the
    outcome rests on."""

    key: str
    file: str
    outcome: str
    by: str
    tests: int
    seconds: float
    judged: str


def read_results(path: Path) -> dict[str, Result]:
    """Latest result of each fault by its key; a line that was cut short is left out."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            result = Result(**json.loads(line))
        except (json.JSONDecodeError, TypeError):
            continue
        found[result.key] = result
    return found


def judged(root: Path, fault: Fault, outcome: str, by: str, names: Sequence[str] | None = None) -> str:
    """What an outcome rests on: the module, and the test file that noticed the fault or, where none did, all
    tests, with those of the test files `names` alone where others were not asked."""
    tests = [by.split("::")[0]] if outcome == NOTICED and "::" in by else []
    if outcome != NOTICED:
        left_out = set(testmap.files_with_tests(root)) - set(names) if names else set()
        files = (n for n in tree_files(root) if n.startswith("tests/") and n.endswith(".py"))
        tests = [n for n in files if n not in left_out]
    digest = hashlib.sha256()
    for name in (fault.file, *tests):
        path = root / name
        digest.update(name.encode() + b"\0" + (path.read_bytes() if path.is_file() else b"gone"))
    return digest.hexdigest()[:16]


def stands(root: Path, fault: Fault, result: Result | None, names: Sequence[str] | None = None) -> bool:
    """Whether an earlier result still holds where these test files are asked, all by default."""
    return result is not None and result.judged == judged(root, fault, result.outcome, result.by, names)


class Runner:
    """Runs in `workers` copies of the tree at `root`; what it finds goes to `results` (out/mutants.jsonl) and
    to out/mutants_map/ at once."""

    def __init__(
        self,
        root: Path,
        out: Path,
        workers: int = 2,
        tell: Callable[[str], None] = print,
        results: Path | None = None,
    ) -> None:
        self.root, self.out, self.workers, self.tell = root, out, workers, tell
        self.results = results or out / "mutants.jsonl"
        self._lock = threading.Lock()

    def run(self, faults: Sequence[Fault], only: Sequence[str] | None = None) -> None:
        """Judge the faults that have no result that still holds. only: names of test files, all by
        default."""
        known = read_results(self.results)
        gone = missing(faults, self.root)
        for fault in gone:
            self.tell(f"its line is gone, draw again: {fault.file}: {fault.line}")
        faults = [f for f in faults if f not in gone]
        due = [f for f in faults if not stands(self.root, f, known.get(f.key), only)]
        self.tell(f"{len(faults) - len(due)} of {len(faults)} faults have a result that still holds")
        if not due:
            return
        self.out.mkdir(parents=True, exist_ok=True)
        with self.results.open("a", encoding="utf-8") as f:
            f.write("\n")  # a line that was cut short must not spoil the next
        with self._copies() as copies:
            maps = self._maps(copies, sorted(only or testmap.files_with_tests(self.root)))
            sources = Sources(copies[0].tree, PACKAGES)

            def judge(copy: Copy, fault: Fault) -> None:
                earlier = known.get(fault.key)
                spots = sources.spots(fault, (copy.tree / fault.file).read_text(encoding="utf-8"))
                result = self._judge(copy, fault, maps, spots, earlier.by if earlier else "")
                with self._lock, self.results.open("a", encoding="utf-8") as f:
                    f.write(json.dumps(asdict(result)) + "\n")
                self.tell(
                    f"{result.outcome:>9} {result.seconds:5.0f} s  {fault.file}: {fault.planted}  {result.by}"
                )

            self._each(copies, due, judge)

    def _maps(self, copies: Sequence[Copy], names: Sequence[str]) -> dict[str, FileMap]:
        """Maps of the test files, measured where there is none of these sources."""
        folder = self.out / "mutants_map"
        paths = {n: folder / f"{n.replace('/', '.')}.json" for n in names}
        trees = {n: testmap.fingerprint(self.root, n) for n in names}
        due = [n for n, p in paths.items() if not p.exists() or testmap.load(p).tree != trees[n]]
        if due:
            self.tell(f"finding out which lines the tests of {len(due)} files run")

        def measure(copy: Copy, name: str) -> None:
            found = testmap.measure(copy, name, trees[name])
            testmap.save(found, paths[name])
            failed = f"; fails without any fault: {', '.join(found.failed)}" if found.failed else ""
            self.tell(f"  {sum(found.seconds.values()):5.0f} s  {name}{failed}")

        self._each(copies, due, measure)
        return {n: testmap.load(p) for n, p in paths.items()}

    def _judge(
        self, copy: Copy, fault: Fault, maps: Mapping[str, FileMap], spots: set[Spot], first: str
    ) -> Result:
        started = monotonic()
        files, order = chosen(fault, maps, spots, copy.tree, first)
        by, outcome, tests = "", NOT_RUN, 0
        if files:
            usual = {t: s for n in files for t, s in maps[n].seconds.items()}
            failing = [t for n in files for t in maps[n].failed]
            with copy.planted(fault):
                told = copy.pytest([*files, *(f"--deselect={t}" for t in failing)], usual, order)
            if copy.stopping:
                raise KeyboardInterrupt
            if told.code not in (None, 0, 1, 2) and told.code > 0:
                raise RuntimeError(
                    f"pytest ends with {told.code} on {fault.file}: {fault.planted}\n{told.output}"
                )
            outcome, tests = (SURVIVED if told.code == 0 else NOTICED), len(told.outcomes)
            ends = told.failed[0] if told.failed else told.last
            by = "" if outcome == SURVIVED else ends or "it can't be imported"
        return Result(
            fault.key, fault.file, outcome, by, tests, round(monotonic() - started, 1),
            judged(self.root, fault, outcome, by, sorted(maps)),
        )  # fmt: skip

    @contextmanager
    def _copies(self) -> Iterator[list[Copy]]:
        folder = Path(tempfile.mkdtemp(prefix="funtwin_mutants_"))
        try:
            copies = [Copy.of(self.root, folder / str(k)) for k in range(self.workers)]
            _must_import(copies[0])
            yield copies
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _each(self, copies: Sequence[Copy], work: Iterable[T], do: Callable[[Copy, T], None]) -> None:
        """Do all work, a thread for each copy; the first error, or an interrupt, ends all."""
        queue: SimpleQueue[T] = SimpleQueue()
        for item in work:
            queue.put(item)
        errors: list[BaseException] = []

        def loop(copy: Copy) -> None:
            while not errors and not copy.stopping:
                try:
                    do(copy, queue.get_nowait())
                except Empty:
                    return
                except BaseException as e:
                    errors.append(e)

        threads = [threading.Thread(target=loop, args=(c,)) for c in copies]
        for t in threads:
            t.start()
        try:
            for t in threads:
                t.join()
        except KeyboardInterrupt:
            for c in copies:
                c.stopping = True
            for t in threads:
                t.join()
            raise
        if errors:
            raise errors[0]


def chosen(
    fault: Fault, maps: Mapping[str, FileMap], spots: set[Spot], root: Path, first: str = ""
) -> tuple[list[str], list[str]]:
    """(test files, tests) that can notice a fault, in the order in which to run them: what noticed it before;
    then files that import its room, then others; quick ones first. In a file the tests that run its lines
    come first, but all may judge what a shared fixture made."""
    room = fault.file.rpartition("/")[0].replace("/", ".")
    rows = []
    for name, found in maps.items():
        tests = found.running(spots)
        if tests and found.seconds:
            near = room in (root / name).read_text(encoding="utf-8")
            cost = sum(map(found.cost, tests))
            rows.append((first.split("::")[0] != name, not near, cost, name))
    rows.sort()
    files = [row[-1] for row in rows]
    order = [t for n in files for t in sorted(maps[n].running(spots) - {""}, key=maps[n].cost)]
    return files, sorted(order, key=lambda t: t != first)


def _must_import(copy: Copy) -> None:
    """The tests of a copy must test the copy."""
    package = next(p for p in PACKAGES if (copy.tree / p).is_dir())
    code = f"import {package}; print({package}.__file__)"
    env = {"PYTHONPATH": str(copy.tree), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=copy.tree, env=env, capture_output=True, text=True, check=True
    )
    if not Path(done.stdout.strip()).resolve().is_relative_to(copy.tree.resolve()):
        raise RuntimeError(
            f"{package} is imported from {done.stdout.strip()}, not from the copy in {copy.tree}"
        )
