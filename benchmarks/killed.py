"""Kill the reconstruction of a walk again and again, go on each time, and compare with one left alone.

    python -m benchmarks.killed RECORDING RUN WORK [--kills 20] [--seed 0]

RUN is a finished run of the walk RECORDING by the same program. In WORK a new run is started, ended by
SIGKILL at a random moment, started again, and so on; at last it is left alone. What a stage has stored when
the run is killed must be the same file at the end, not one written again, and the twin that of RUN, byte
by byte but for its provenance. Prints rows for benchmarks/killed.md; exit code 2 where something differs.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from random import Random

# s after the start before which a run only imports
_IMPORTS = 3.0


def stored(run: Path) -> dict[str, tuple[str, int]]:
    """Key and time (ns) of each stage, of windows and submaps too, that a run has stored."""
    found = {}
    for path in run.glob("stages/**/stage.json"):
        record = json.loads(path.read_text())
        found[str(record["name"])] = str(record["key"]), path.stat().st_mtime_ns
    return found


def twin_of(run: Path) -> dict[str, bytes]:
    """The twin's files; its text without provenance."""
    files = {p.name: p.read_bytes() for p in sorted((run / "twin").rglob("*")) if p.is_file()}
    told = json.loads(files.pop("twin.json"))
    told.pop("provenance", None)
    return files | {"twin.json": json.dumps(told, sort_keys=True).encode()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("recording", type=Path)
    parser.add_argument("whole", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    run, rng = options.work / "run", Random(options.seed)  # noqa: S311 (moments, no secrets)
    shutil.rmtree(run, ignore_errors=True)
    command = [sys.executable, "-m", "twin", "reconstruct", str(options.recording), "-o", str(run)]
    seconds = sum(s["seconds"] for s in json.loads((options.whole / "manifest.json").read_text())["stages"])
    first: dict[str, tuple[str, int]] = {}
    for k in range(options.kills):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        moment = _IMPORTS + rng.random() * 2.0 * seconds / options.kills
        try:
            process.wait(moment)
            print(f"killed {k} times, then done", flush=True)
            break
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        time.sleep(1.0)  # its workers notice that it has gone
        now = stored(run)
        first = now | first
        print(f"| {k + 1} | {moment:.1f} s | {len(now)} stored |", flush=True)
    done = subprocess.run(command, capture_output=True, text=True)
    again = sorted(name for name, what in first.items() if stored(run).get(name) != what)
    mine, whole = twin_of(run), twin_of(options.whole)
    other = sorted(name for name in mine.keys() | whole.keys() if mine.get(name) != whole.get(name))
    print(
        f"exit code {done.returncode}; solved twice: {again or 'none'}; files that differ: {other or 'none'}"
    )
    return 2 if again or other else 0


if __name__ == "__main__":
    sys.exit(main())
