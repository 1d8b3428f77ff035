"""Copies of the tree in which faults are planted, and pytest in them; the user's checkout is never
changed."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from benchmarks.mutants.faults import HERE, Fault
from benchmarks.mutants.plugin import LOG, ORDER

START_S = 300.0  # for imports, collection, and numba's compiling anew
LEAST_S, TIMES = 120.0, 5.0  # a test hangs when it takes TIMES its usual time, and at least LEAST_S
_stamps = count(
    2_000_000_000
)  # every planted file has a time of its own, or Python would take an earlier one's byte code


@dataclass(frozen=True)
class Told:
    """What a run of pytest told: its exit code (None: a test took too long), each test's outcome and seconds,
    the test that ran last, and the end of its output."""

    code: int | None
    outcomes: Mapping[str, str]
    seconds: Mapping[str, float]
    last: str
    output: str

    @property
    def failed(self) -> list[str]:
        return [t for t, o in self.outcomes.items() if o == "failed"]


@dataclass
class Copy:
    """A copy of the files that git knows or would take, in a folder of its own."""

    folder: Path
    stopping: bool = field(default=False)

    @classmethod
    def of(cls, root: Path, folder: Path) -> Copy:
        """Copy the tree at `root` to the new folder; of a tree without git, all but hidden folders and
        caches."""
        for name in tree_files(root):
            target = folder / "tree" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, target)
        (folder / "plugin").mkdir()
        shutil.copy2(HERE / "plugin.py", folder / "plugin" / "mutants_plugin.py")
        return cls(folder)

    @property
    def tree(self) -> Path:
        return self.folder / "tree"

    @contextlib.contextmanager
    def planted(self, fault: Fault) -> Iterator[None]:
        """The fault stands in the copy; afterwards the file is as it was, to its time stamp."""
        path = self.tree / fault.file
        source, before = path.read_text(encoding="utf-8"), path.stat()
        with self._compiled_anew(path):
            path.write_text(fault.plant(source), encoding="utf-8")
            stamp = next(_stamps)
            os.utime(path, (stamp, stamp))
            try:
                yield
            finally:
                path.write_text(source, encoding="utf-8")
                os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))

    @contextlib.contextmanager
    def _compiled_anew(self, path: Path) -> Iterator[None]:
        """Without what numba has stored of a file and of the files that compile its functions into theirs:
        numba sees only that a function's own file has changed."""
        stored = [
            p
            for file in self._compiled_from(path)
            for p in (file.parent / "__pycache__").glob(f"{file.stem}.*.nb?")
        ]
        kept = self.folder / "kept"
        kept.mkdir()
        moved = [(p, kept / str(k)) for k, p in enumerate(stored)]
        for p, aside in moved:
            p.rename(aside)
        try:
            yield
        finally:
            for file in self._compiled_from(path):
                for p in (file.parent / "__pycache__").glob(f"{file.stem}.*.nb?"):
                    p.unlink()
            for p, aside in moved:
                aside.rename(p)
            kept.rmdir()

    def _compiled_from(self, path: Path) -> list[Path]:
        """Files that import numba and this file, at once or through one another; with the file itself."""
        jitted = {p: p.read_text(encoding="utf-8") for p in self.tree.glob("recon/**/*.py")}
        jitted = {p: text for p, text in jitted.items() if "numba" in text}
        found = [path]
        for file in found:
            module = ".".join(file.relative_to(self.tree).with_suffix("").parts)
            package, _, name = module.rpartition(".")
            imports = (f"from {module} import", f"import {module}", f"from {package} import {name}")
            found += [p for p, text in jitted.items() if p not in found and any(i in text for i in imports)]
        return found

    def pytest(
        self,
        files: Sequence[str],
        usual: Mapping[str, float] | None = None,
        order: Sequence[str] | None = None,
        before: Sequence[str] = (),
    ) -> Told:
        """Run pytest on test files; with `order`, up to the first failure, and killed once a test takes too
        long for its `usual` seconds. before: arguments of Python in front of `-m pytest`."""
        log, told = self.folder / "log.jsonl", self.folder / "output.txt"
        log.write_text("")
        env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "PYTEST_ADDOPTS", ORDER)}
        env |= {"PYTHONPATH": f"{self.tree}{os.pathsep}{self.folder / 'plugin'}", LOG: str(log)}
        env.setdefault("OMP_NUM_THREADS", "1")
        command = [
            sys.executable,
            *before,
            "-m",
            "pytest",
            "-m",
            "not slow",
            "-p",
            "mutants_plugin",
            "-p",
            "no:cacheprovider",
        ]
        command += ["--tb=line", "-q"]
        if order is not None:
            (self.folder / "order.json").write_text(json.dumps(order))
            env[ORDER] = str(self.folder / "order.json")
            command.append("-x")
        with told.open("w") as out:
            process = subprocess.Popen(
                [*command, *files],
                cwd=self.tree,
                env=env,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            code = self._wait(process, log, usual or {}, order is not None)
        return _told(code, log, told)

    def _wait(
        self, process: subprocess.Popen[bytes], log: Path, usual: Mapping[str, float], limited: bool
    ) -> int | None:
        """Exit code, None when a test took too long; whatever happens, nothing of the run is left behind."""
        last, since = "", time.monotonic()
        try:
            while process.poll() is None:
                time.sleep(0.2)
                running = _last_started(log)
                if running != last:
                    last, since = running, time.monotonic()
                limit = max(LEAST_S, TIMES * usual.get(last, 0.0)) if last in usual else START_S
                if self.stopping or (limited and time.monotonic() - since > limit):
                    return None
            return process.returncode
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def tree_files(root: Path) -> list[str]:
    """Names of the files of a tree."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root,
        capture_output=True,
        text=True,
    )
    if listed.returncode == 0:
        names = listed.stdout.split("\0")
        return sorted(n for n in names if n and (root / n).is_file())
    hidden = {"__pycache__", "out", "build", "dist"}
    paths = [p.relative_to(root) for p in root.rglob("*") if p.is_file()]
    return sorted(p.as_posix() for p in paths if not any(x.startswith(".") or x in hidden for x in p.parts))


def _lines(log: Path) -> list[dict[str, object]]:
    text = log.read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines() if line.endswith("}")]


def _last_started(log: Path) -> str:
    return str(next((said["start"] for said in reversed(_lines(log)) if "start" in said), ""))


def _told(code: int | None, log: Path, output: Path) -> Told:
    outcomes: dict[str, str] = {}
    seconds: dict[str, float] = {}
    for said in _lines(log):
        if "test" in said:
            test, outcome = str(said["test"]), str(said["outcome"])
            seconds[test] = seconds.get(test, 0.0) + float(str(said["seconds"]))
            outcomes[test] = outcome if outcomes.get(test, "passed") == "passed" else outcomes[test]
    return Told(
        code,
        outcomes,
        seconds,
        _last_started(log),
        output.read_text(encoding="utf-8", errors="replace")[-2000:],
    )
