"""The verb `batch` of the command line: many recordings, whatever fails."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence, Set
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from twin.batch import Batch, Settings, Unit, units_of
from twin.batch.batch import State
from twin.batch.journal import JOURNAL, latest
from twin.batch.page import INDEX, write_page
from twin.batch.table import TABLE, write_table
from twin.batch.units import shard as every_nth
from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.table import SETTINGS, named
from twin.errors import InputError
from twin.files.room import FULL
from twin.report.sections import Table


def batch(
    console: Console,
    recordings: Sequence[str],
    out: Path,
    shard: str,
    config: Path | None,
    set: Sequence[str],
    dry_run: bool,
    page: bool,
    **how: Any,
) -> Outcome:
    """Take the recordings through the verbs, write page and table. how: do, workers, retry, timeout, memory,
    keep, backend and address, as the command line has them."""
    if page:
        return _told(out, _as_it_is(out))
    given.settings(named(SETTINGS["reconstruct"]), config, set)  # refuses what is none
    options = [*(["--config", str(config.resolve())] if config else []), *(f"--set={s}" for s in set)]
    verbs, memory, ray = how.pop("do"), 1000 * how.pop("memory"), how.pop("backend") == "ray"
    if how["address"] and not ray:
        raise InputError(f"--address {how['address']} is of a Ray cluster", "give --backend ray too")
    settings = Settings(verbs, tuple(options), memory_mb=memory, ray=ray, **how)
    every = units_of(recordings)
    units = every_nth(every, shard)
    if not units:
        raise InputError(f"shard {shard} of {len(every)} recordings is empty", "give fewer shards")
    whole = Batch(units, out, settings)
    if dry_run:
        left = {u.id for u in whole.left()}
        rows = [[u.id, u.source, "to do" if u.id in left else "done"] for u in units]
        data = {"units": [{"id": u.id, "recording": u.source, "done": u.id not in left} for u in units]}
        return Outcome(data, [Table(f"{len(left)} of {len(units)} to do", ["id", "recording", ""], rows)])
    so_far = _PageSoFar(out)
    # Ray tells its own troubles on stdout, where the results go
    with console.progress() as progress, redirect_stdout(sys.stderr):

        def tell(state: State) -> None:
            busy = ", ".join(f"{name} ({verb})" for name, verb in list(state.busy.items())[:3])
            progress(
                "batch", state.done / len(units), f"{state.done} of {len(units)}; {busy}" if busy else ""
            )
            so_far.write(state)

        state = whole.go(tell)
    return _told(out, state)


class _PageSoFar:
    """The page while the batch goes on: written as units end, in a tenth of the time: it reads all twins."""

    def __init__(self, out: Path) -> None:
        self._out, self._due = out, 0.0
        self._shown: Set[str] | None = None

    def write(self, state: State) -> None:
        """Write it, if it is due and says something new."""
        began = time.monotonic()
        if began < self._due or self._shown == state.rows.keys():
            return
        try:
            write_page(self._out, state)
            self._shown = state.rows.keys()
        except OSError as e:  # the next look tries again; the last page is written, or its error told
            if e.errno not in FULL:
                raise
        self._due = began + 10.0 * (time.monotonic() - began)


def _as_it_is(out: Path) -> State:
    """All units that a batch ever finished in a folder. Raises InputError where there is none."""
    rows = latest(out)
    if not rows:
        raise InputError(f"{out} holds no {JOURNAL}", "give the folder of a batch")
    return State([Unit(k, str(r.get("recording", ""))) for k, r in sorted(rows.items())], rows, {})


def _told(out: Path, state: State) -> Outcome:
    """What became of all, once page and table are written."""
    index, table = write_page(out, state), write_table(out, state.rows)
    rows = [
        [k, r["verdict"] or "-", f"{r['seconds']:.0f} s", r["error"]] for k, r in sorted(state.rows.items())
    ]
    failed = [k for k, r in state.rows.items() if r["exit"] == 1]
    ends = Counter("failed" if r["exit"] == 1 else r["verdict"] or "no twin" for r in state.rows.values())
    summary = ", ".join(f"{count} {end}" for end, count in ends.most_common())
    data: dict[str, Any] = {
        "page": str(index),
        "table": str(table),
        "units": [state.rows[k] for k in sorted(state.rows)],
    }
    return Outcome(
        data,
        [
            Table(
                f"{len(state.rows)} of {len(state.units)} done: {summary}",
                ["recording", "verdict", "time", "error"],
                rows,
            )
        ],
        [f"page: {out / INDEX}", f"table: {out / TABLE}"],
        ok=all(r["exit"] == 0 for r in state.rows.values()),
        doubt=f"{len(failed)} of {len(state.rows)} failed; --retry failed does them again" if failed else "",
    )
