"""End every verb of the command at random moments, by Ctrl-C and by SIGKILL, and see what is lost.

    python benchmarks/interrupts.py WORK [--seed 0] [--verbs reconstruct export] [--trials 4]

Each trial works on a fresh copy of a finished run of the shipped recording with files and keys of a user's
strewn over it. The moment is uniform between 0.05 s after the start and the time that the verb took
undisturbed; every other signal is SIGINT to the process group, as a terminal sends it, the others SIGKILL to
the process. Afterwards the user's files and every file of ours are looked at, then the same command runs
again, undisturbed: its exit code and its result must be those of a run that was never disturbed.
WORK/trials.jsonl keeps what was tried: the same call goes on. Writes benchmarks/interrupts.md. Nothing else
must write to WORK; an idle machine is not needed.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks import interrupt_cases as cases

FIRST = 0.05  # s after the start
INTERRUPTED = "twin: interrupted; run the same command again to go on"


@dataclass(frozen=True)
class Reference:
    """What an undisturbed call does: seconds on a run of which nothing is done, exit code, result."""

    seconds: float
    code: int
    result: dict[str, str]


@dataclass(frozen=True)
class Trial:
    """One ended call: the signal, the moment (s) and the share of the expected time, exit code, and what was
    found wrong."""

    verb: str
    sent: str
    moment: float
    code: int
    faults: tuple[str, ...]

    @property
    def finished(self) -> bool:
        """It was done before the signal came."""
        return self.code in (0, 2)


def reference(base: Path, work: Path, case: cases.Case) -> Reference:
    """Time and result of the verb undisturbed; kept in WORK."""
    kept = work / f"{case.verb}_reference.json"
    if kept.exists():
        return Reference(**json.loads(kept.read_text()))
    place = _fresh(work / f"{case.verb}_reference")
    whole = cases.Case(case.verb, case.arguments, results=case.results)
    cases.make_place(base, place, whole, Random(0))  # noqa: S311
    if case.prepare is cases.stages_left:
        shutil.rmtree(place / "run/twin")
    started = time.monotonic()
    process = cases.start(case.verb, case.arguments, place)
    process.communicate()
    seconds = time.monotonic() - started
    if case.prepare is cases.stages_left:  # the stages were there: what they took comes on top
        seconds += cases.stage_seconds(base / "run")
    found = cases.result(case, place)
    shutil.rmtree(place)
    told = Reference(seconds, process.returncode, found)
    kept.write_text(json.dumps(asdict(told)))
    return told


def trial(base: Path, work: Path, case: cases.Case, told: Reference, number: int, seed: int) -> Trial:
    """End the verb once, look, and run it again."""
    rng = Random(f"{seed} {case.verb} {number}")  # noqa: S311  (moments, not secrets)
    place = _fresh(work / f"{case.verb}_{number}")
    share = cases.make_place(base, place, case, rng)
    before, mine = cases.state(place), cases.of_user(place)
    sent = signal.SIGINT if number % 2 == 0 else signal.SIGKILL
    moment = FIRST + rng.random() * max(told.seconds * share - FIRST, 0.0)
    process = cases.start(case.verb, case.arguments, place)
    time.sleep(moment)
    with suppress(ProcessLookupError):
        if sent == signal.SIGINT:
            os.killpg(process.pid, sent)
        else:
            process.kill()
    err, faults = _end(process, sent)
    faults += [f"said {t}" for t in cases.TELLTALES if t in err]
    faults += _code_faults(process.returncode, told.code, sent, err)
    faults += cases.harm(place, before, mine)
    if sent == signal.SIGINT and any((place / "tmp").iterdir()):
        faults.append(f"left {next((place / 'tmp').iterdir()).name} in the temporary folder")
    again = cases.start(case.verb, case.arguments, place)
    err, more = _end(again, None)
    faults += more
    done = case.once and case.once in err and cases.result(case, place) == told.result
    if again.returncode != told.code and not done:
        faults.append(f"again: exit code {again.returncode}: {err.strip()[-200:]}")
    faults += [f"again: {h}" for h in cases.harm(place, before, mine)]
    faults += [f"again: left {name}" for name in cases.leftovers(place, mine)]
    after = cases.result(case, place)
    faults += [f"again: {p} is another" for p in sorted(told.result) if after.get(p) != told.result[p]][:3]
    if not faults:
        shutil.rmtree(place)
    return Trial(case.verb, sent.name, moment, process.returncode, tuple(dict.fromkeys(faults)))


def _end(process: subprocess.Popen[str], sent: signal.Signals | None) -> tuple[str, list[str]]:
    """Wait for the end of the process; returns what it said, and a fault when it, or what it started, does
    not end."""
    try:
        _, err = process.communicate(timeout=600 if sent is None else 60)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[1], ["did not end"]
    left = []
    if sent == signal.SIGINT:
        listed = subprocess.run(
            ["ps", "-o", "stat=,args=", "-s", str(process.pid)], capture_output=True, text=True
        )
        left = [f"left a process: {x}" for x in listed.stdout.splitlines() if not x.startswith("Z")][:1]
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    return err, left


def _code_faults(code: int, normal: int, sent: signal.Signals, err: str) -> list[str]:
    if sent == signal.SIGKILL or code == normal:
        return []
    if code == -signal.SIGINT and not err:
        return []  # before Python itself listens: a shell calls it 130
    if code != 130:
        return [f"exit code {code}: {err.strip()[-200:]}"]
    said = [line for line in err.splitlines() if line.startswith("twin: ")]
    return [] if said == [INTERRUPTED] else [f"said {said}"]


def _fresh(place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    return place


def table(trials: Sequence[Trial]) -> list[str]:
    """Lines of Markdown, one row a verb."""
    rows = [
        "| verb | SIGINT | SIGKILL | done before | exit codes | tracebacks | lost or torn | other |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for verb in [*dict.fromkeys(t.verb for t in trials), "all"]:
        mine = [t for t in trials if verb in (t.verb, "all")]
        sent = Counter(t.sent for t in mine)
        codes = ", ".join(f"{n} × {code}" for code, n in sorted(Counter(t.code for t in mine).items()))
        faults = [f for t in mine for f in t.faults]
        said = sum(f.startswith("said") for f in faults)
        lost = sum(f.removeprefix("again: ").startswith(("lost", "torn")) for f in faults)
        cells = [verb, sent["SIGINT"], sent["SIGKILL"], sum(t.finished for t in mine), codes, said, lost]
        rows.append("| " + " | ".join(map(str, [*cells, len(faults) - said - lost])) + " |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("work", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--verbs", nargs="+", default=[c.verb for c in cases.CASES])
    parser.add_argument("--trials", type=int, help="of each verb at most [4 to 15]")
    options = parser.parse_args()
    base, log = options.work / "base", options.work / "trials.jsonl"
    cases.make_base(base)
    known = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    trials = [Trial(**row | {"faults": tuple(row["faults"])}) for row in known]
    for case in [c for c in cases.CASES if c.verb in options.verbs]:
        done = sum(t.verb == case.verb for t in trials)
        wanted = min(options.trials or case.count, case.count)
        if done >= wanted:
            continue
        told = reference(base, options.work, case)
        print(f"{case.verb}: {told.seconds:.1f} s, exit code {told.code}", flush=True)
        for k in range(done, wanted):
            t = trial(base, options.work, case, told, k, options.seed)
            trials.append(t)
            with log.open("a") as out:
                out.write(json.dumps(asdict(t)) + "\n")
            print(f"  {k} {t.sent} at {t.moment:.2f} s: {t.code} {'; '.join(t.faults)}", flush=True)
    print("\n".join(table(trials)))
    trials.sort(key=lambda t: [c.verb for c in cases.CASES].index(t.verb))
    head = ["# Verbs ended at random moments", "", *(__doc__ or "").splitlines()[4:], ""]
    text = [*head, f"Seed {options.seed}, {len(trials)} signals.", "", *table(trials)]
    Path(__file__).with_suffix(".md").write_text("\n".join(text) + "\n")
    sys.exit(any(t.faults for t in trials))


if __name__ == "__main__":
    main()
