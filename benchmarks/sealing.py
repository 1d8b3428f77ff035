"""Random recordings that nobody has looked at: seeds that follow from the commit, clips measured alone,
counters and nothing else kept."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from recon.simulate.random.strata import Stratum
from twin.errors import InputError
from twin.files.text import write_json
from twin.runs.threads import each

ROOT = Path(__file__).parents[1]
OPEN_SEEDS = 10_000
# The command of any commit: `main` was a function in twin/cli.py before it was a module
TWIN = "from twin.cli import main; getattr(main, 'main', main)()"
MINUTES = 20  # after which a clip counts as failed

Rows = list[dict[str, int]]


def sealed_seed(commit: str, index: int) -> int:
    """The seed of clip `index`: nobody can know it before the commit is made, and it is none of the open
    ones."""
    digest = hashlib.sha256(f"{commit}:{index}".encode()).digest()
    return OPEN_SEEDS + int.from_bytes(digest[:6], "big")


def counted(found: Mapping[str, Any], stratum: Stratum) -> Counter[str]:
    """What is kept of a clip: how many parts of its group, and of each of its factors, did what."""
    group = stratum.group
    names = [group, f"{group} sensor {stratum.sensor}"]
    if group != "negative":
        names += [f"{group} view {stratum.view}", f"{group} short {'yes' if stratum.short else 'no'}"]
        names.append(f"{group} picture {'hard' if stratum.hard_picture else 'clean'}")
    else:
        names.append(f"negative {stratum.negative}")
    out: Counter[str] = Counter()
    for name in names:
        for key, value in found.items():
            out[f"{name}: {key}"] += value
    return out


def clip_alone(module: str, words: Sequence[object], codes: Sequence[Path]) -> Rows:
    """Counters of one clip by each code, made and measured in a process of its own, of which nothing else is
    left.

    Args:
        module: whose verb `clip` is called.
        words: that tell the clip.
        codes: folders of the code that is measured; they follow the clip's place on the command line.
    """
    with tempfile.TemporaryDirectory(prefix="unseen") as place:
        command = [sys.executable, "-m", module, "clip", *map(str, words), place, *map(str, codes)]
        try:
            done = subprocess.run(
                command,
                cwd=ROOT,
                capture_output=True,
                timeout=60 * MINUTES * len(codes),
                env=environment(ROOT),
            )
            told = [json.loads(line) for line in done.stdout.decode().strip().splitlines()[-len(codes) :]]
            broken = _error_kind(done.stderr.decode(errors="replace"), done.returncode)
        except subprocess.TimeoutExpired:
            told, broken = [], "time"
        except ValueError:
            told, broken = [], "output"
    if len(told) != len(codes):
        return [{"clips": 1, "broken": 1, f"broken {broken}": 1} for _ in codes]
    return [{k: int(v) for k, v in row.items()} for row in told]


def _error_kind(stderr: str, code: int) -> str:
    """The name of the error that ended a clip's process, which tells nothing of the clip; its exit code where
    it names none."""
    last = stderr.strip().splitlines()[-1:]
    named = re.match(r"([A-Za-z_.]+(?:Error|Exception|Interrupt))\b", last[0]) if last else None
    return named.group(1).rpartition(".")[2] if named else f"exit {code}"


def go_on(
    path: Path,
    state: dict[str, Any],
    strata: Mapping[int, Stratum],
    names: Sequence[str],
    measured: Callable[[int], Rows],
) -> None:
    """Measure the clips that `state` doesn't list as done, as many at a time as there are cores, and keep it
    in a file after each.

    Args:
        path: of the file.
        state: "done", and the counters so far under each of `names`.
        strata: of every clip, by its index.
        names: where the rows that `measured` returns are added, in their order.
        measured: counters of the clip of an index.
    """
    left = [i for i in strata if i not in state["done"]]
    for i, rows in zip(left, each(measured, left), strict=True):
        for name, found in zip(names, rows, strict=False):
            state[name] = dict(sorted((Counter(state[name]) + counted(found, strata[i])).items()))
        state["done"] = sorted([*state["done"], i])
        write_json(path, state)
        print(f"{len(state['done'])} of {len(strata)}", flush=True)


def twin_verb(code: Path, folder: Path, *words: str) -> int:
    """Exit code of `twin` with these words, by the code in a folder, started in another."""
    command = [sys.executable, "-c", TWIN, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, env=environment(code)).returncode


def environment(code: Path) -> dict[str, str]:
    """This process' own, with the code in a folder before all other."""
    return os.environ | {"PYTHONPATH": str(code)}


def git(*words: str) -> str:
    """What git says in this tree."""
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def commit() -> str:
    """The commit that this tree is of. Raises InputError when it has changes."""
    if git("status", "--porcelain"):
        raise InputError(
            "the tree has changes that are in no commit", "commit them: a sealed run is of a commit"
        )
    return git("rev-parse", "--short=10", "HEAD")
