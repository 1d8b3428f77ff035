"""Which test runs which line, measured by coverage, a test file at a time and each in a process of its own,
so that what a fixture or a cached scene of another file ran does not count. Lines that child processes run
count too."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.mutants.copies import Copy, tree_files

PACKAGES = ("recon", "robots", "twin")
SETTINGS = """[run]
source = {source}
parallel = true
patch = subprocess
sigterm = true
disable_warnings = no-data-collected,module-not-measured
"""


@dataclass(frozen=True)
class FileMap:
    """What the tests of one file run. tree: of the sources it was measured on; seconds: of each test that
    passed; failed: tests that fail without any fault; lines: file -> line -> tests, "" for what runs outside
    of any."""

    tree: str
    seconds: dict[str, float]
    failed: list[str]
    lines: dict[str, dict[int, list[str]]]

    def cost(self, test: str) -> float:
        """Usual seconds of a test; 0 for one that did not pass."""
        return self.seconds.get(test, 0.0)

    def running(self, spots: Iterable[tuple[str, int]]) -> set[str]:
        """Tests that run one of the lines (file, number)."""
        return {t for file, line in spots for t in self.lines.get(file, {}).get(line, [])}


def files_with_tests(root: Path) -> list[str]:
    """Names of the files that hold tests."""
    return [
        n
        for n in tree_files(root)
        if n.startswith("tests/") and n.rpartition("/")[2].startswith("test_") and n.endswith(".py")
    ]


def fingerprint(root: Path, name: str) -> str:
    """Hash of everything but other test files that decides what the tests of a file run."""
    sources = [
        n
        for n in tree_files(root)
        if n.endswith(".py") and n.split("/")[0] in (*PACKAGES, "tests", "benchmarks")
    ]
    others = {*files_with_tests(root)} - {name}
    digest = hashlib.sha256()
    for n in sources:
        if n not in others and not n.startswith("benchmarks/mutants/"):
            digest.update(n.encode() + b"\0" + (root / n).read_bytes())
    return digest.hexdigest()[:16]


def measure(copy: Copy, name: str, tree: str) -> FileMap:
    """Run the tests of a file under coverage."""
    data = copy.folder / "coverage"
    for old in data.parent.glob("coverage*"):
        old.unlink()
    rc = copy.folder / "rc.ini"
    rc.write_text(SETTINGS.format(source=",".join(p for p in PACKAGES if (copy.tree / p).is_dir())))
    told = copy.pytest([name], before=["-m", "coverage", "run", f"--rcfile={rc}", f"--data-file={data}"])
    passed = {t: s for t, s in told.seconds.items() if told.outcomes[t] == "passed"}
    if told.code not in (0, 1, 5):
        raise RuntimeError(f"pytest ends with {told.code} on {name}:\n{told.output}")
    return FileMap(tree, passed, told.failed, dict(_lines(copy, data)))


def _lines(copy: Copy, data: Path) -> Iterator[tuple[str, dict[int, list[str]]]]:
    from coverage import CoverageData

    every = CoverageData(basename=str(data))
    for part in sorted(data.parent.glob("coverage.*")):
        some = CoverageData(basename=str(part))
        some.read()
        every.update(some)
    for file in every.measured_files():
        by_line = every.contexts_by_lineno(file)
        yield Path(file).relative_to(copy.tree).as_posix(), {k: sorted(set(v)) for k, v in by_line.items()}


def load(path: Path) -> FileMap:
    """A stored map."""
    raw = json.loads(path.read_text(encoding="utf-8"))
    tests = raw.pop("tests")
    lines = {f: {int(k): [tests[i] for i in v] for k, v in of.items()} for f, of in raw.pop("lines").items()}
    return FileMap(lines=lines, **raw)


def save(found: FileMap, path: Path) -> None:
    """Store a map; tests are named once."""
    raw = asdict(found)
    tests = sorted({t for of in found.lines.values() for v in of.values() for t in v})
    number = {t: k for k, t in enumerate(tests)}
    raw["lines"] = {f: {k: [number[t] for t in v] for k, v in of.items()} for f, of in found.lines.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps({"tests": tests, **raw}))
    temporary.rename(path)
