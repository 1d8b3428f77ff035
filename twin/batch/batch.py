"""The batch: takes units that nobody has, works on as many at a time as it may, tells what became of each."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from twin.batch.claims import PULSE, Claims
from twin.batch.journal import append, has_room, latest
from twin.batch.units import Unit
from twin.batch.work import LOOK, SHARE, Limits, Work, machine_mb, row_of, slim
from twin.errors import InputError
from twin.files.room import FULL, free_mb

Retry = Literal["", "failed", "doubtful", "all"]
Keep = Literal["all", "exports", "twin"]
# s between two looks for units that another batch gave up. Chosen by us.
_WAIT = 5.0
# MB of the disk without which no unit is begun: a clip's run takes 77 (benchmarks/fleet.md). Chosen by us.
RUN_MB = 100.0


@dataclass(frozen=True)
class Settings:
    """What is done with each unit, and how.

    verbs: of VERBS. options: of `twin reconstruct`. workers: units at a time; 0 takes half of the cores.
    timeout: s a unit. memory_mb: of a unit; 0 shares what the machine has to give. retry: which of the units
    that are done are done again. keep: what stays of a run. ray: the units are Ray's tasks, of the cluster at
    `address`, or of this machine.
    """

    verbs: tuple[str, ...] = ("reconstruct", "evaluate")
    options: tuple[str, ...] = ()
    workers: int = 0
    timeout: float = 3600.0
    memory_mb: float = 0.0
    retry: Retry = ""
    keep: Keep = "all"
    ray: bool = False
    address: str = ""

    @property
    def digest(self) -> str:
        """Of what decides the results; not of how many work on them."""
        told = json.dumps([self.verbs, self.options, self.keep])
        return hashlib.sha256(told.encode()).hexdigest()[:12]

    @property
    def at_a_time(self) -> int:
        return self.workers or max(1, len(os.sched_getaffinity(0)) // 2)

    @property
    def limits(self) -> Limits:
        """Of one unit of those that are worked on at a time."""
        memory = self.memory_mb or SHARE * machine_mb() / self.at_a_time
        threads = max(1, len(os.sched_getaffinity(0)) // self.at_a_time)
        return Limits(self.timeout, memory, threads)


@dataclass(frozen=True)
class State:
    """How far a batch is. rows: of units that are done, by id. busy: ids with the verb at work."""

    units: Sequence[Unit]
    rows: dict[str, dict[str, Any]]
    busy: dict[str, str]
    seconds_left: float | None = None

    @property
    def done(self) -> int:
        return sum(u.id in self.rows for u in self.units)


Told = Callable[[State], None]


class AtWork(Protocol):
    """A unit at work: `twin.batch.work.Work`, or a task somewhere else."""

    unit: Unit

    @property
    def run(self) -> Path: ...
    @property
    def doing(self) -> str: ...
    def step(self) -> bool: ...
    def stop(self) -> None: ...


Begin = Callable[[Unit], AtWork]
Row = Callable[[Any], dict[str, Any]]  # the line of a unit whose work is at its end


class Batch:
    """Units in a folder.

    Raises InputError for a folder that can't be written.
    """

    def __init__(self, units: Sequence[Unit], folder: Path, settings: Settings) -> None:
        self.units, self.folder, self.settings = list(units), folder, settings
        self._begun = time.time()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.claims = Claims(folder)
        except OSError as e:
            raise InputError(
                f"{folder} can't be written ({e.strerror})", "give a folder that you may write"
            ) from e

    def left(self) -> list[Unit]:
        """The units that are still to do."""
        return self._left(latest(self.folder))

    def _left(self, rows: dict[str, dict[str, Any]]) -> list[Unit]:
        return [u for u in self.units if not self._settled(rows.get(u.id))]

    def _settled(self, row: dict[str, Any] | None) -> bool:
        """Whether a unit is done, by these settings, and not to be done again."""
        if row is None or row.get("settings") != self.settings.digest:
            return False
        if float(row.get("ended", 0.0)) >= self._begun:
            return True  # again, by this batch or one beside it
        code, retry = row.get("exit"), self.settings.retry
        again = {
            "": False, "all": True, "failed": code == 1, "doubtful": code == 2 or row.get("verdict") == "doubtful",
        }  # fmt: skip
        return not again[retry]

    def go(self, told: Told) -> State:
        """Work until every unit is done, by this batch or another one, and return how it ended. told: hears
        of every change. An interruption ends all processes and gives their units back.

        Raises InputError where a full disk leaves no room for another unit; those at work have ended then.
        """
        with self._backend() as (begin, row, room):
            return self._go(told, begin, row, room)

    @contextmanager
    def _backend(self) -> Iterator[tuple[Begin, Row, int]]:
        """How units are begun and told, and how many at a time."""
        settings, limits = self.settings, self.settings.limits

        def work(unit: Unit) -> Work:
            return Work(unit, self.folder, settings.verbs, settings.options, limits)

        if not settings.ray:
            yield work, lambda w: row_of(w, settings.digest, self.claims.host), settings.at_a_time
            return
        from twin.batch import ray_tasks

        with ray_tasks.connected(settings.address):
            room = ray_tasks.places(limits, settings.memory_mb)
            yield (
                lambda unit: ray_tasks.begun(work(unit), settings.digest, settings.memory_mb),
                lambda task: dict(task.row()),
                settings.workers or room,
            )

    def _go(self, told: Told, begin: Begin, row: Row, room: int) -> State:
        works: list[AtWork] = []
        done_here = 0
        started = pulsed = time.monotonic()
        try:
            while True:
                rows = latest(self.folder)
                left = self._left(rows)
                if not self._begin_more(left, works, begin, room) and not works:
                    raise self._full(len(left))
                spent = time.monotonic() - started
                waiting = len(left)
                share = spent / done_here if done_here else None
                told(self._state(rows, works, None if share is None else share * waiting))
                if not works and not left:
                    return self._state(rows, [], 0.0)
                until = time.monotonic() + (_WAIT if not works else _WAIT / 2)
                while time.monotonic() < until:
                    ended = [w for w in works if not w.step()]
                    for work in ended:
                        self._finish(work, row(work))
                        works.remove(work)
                        done_here += 1
                    if time.monotonic() - pulsed > PULSE:
                        pulsed = time.monotonic()
                        works = [w for w in works if self._still_ours(w)]
                    if ended:
                        break
                    time.sleep(LOOK)
        finally:
            for work in works:
                work.stop()
                self.claims.release(work.unit.id)

    def _begin_more(self, left: Sequence[Unit], works: list[AtWork], begin: Begin, room: int) -> bool:
        """Begin units that nobody has, as many as there is room for; False where the disk is full: what would
        become of another unit could not be told."""
        ours = {w.unit.id for w in works}
        free = [u for u in left if u.id not in ours]
        if not free or len(works) >= room:
            return True
        if free_mb(self.folder) < RUN_MB or not has_room(self.folder, room):
            return False
        for unit in free:
            if len(works) >= room:
                break
            try:
                taken = self.claims.take(unit.id)
            except OSError as e:
                if e.errno in FULL:
                    return False
                raise
            if taken and self._settled(latest(self.folder).get(unit.id)):  # done since we looked
                self.claims.release(unit.id)
            elif taken:
                works.append(begin(unit))
        return True

    def _full(self, left: int) -> InputError:
        every = len(self.units)
        return InputError(
            f"the disk of {self.folder} is full ({free_mb(self.folder):.0f} MB left), "
            f"{every - left} of {every} recordings are done",
            "free some space and run again: what was computed is kept",
        )

    def _still_ours(self, work: AtWork) -> bool:
        if self.claims.pulse(work.unit.id):
            return True
        work.stop()  # this batch slept, and another one took it for dead
        return False

    def _finish(self, work: AtWork, row: dict[str, Any]) -> None:
        """Write its line first: a unit that is told is done, whatever happens next."""
        append(self.folder, {**row, "ended": round(time.time(), 3)})
        slim(work.run, self.settings.keep)
        self.claims.release(work.unit.id)

    def _state(
        self, rows: dict[str, dict[str, Any]], works: Sequence[AtWork], seconds_left: float | None
    ) -> State:
        settled = {k: r for k, r in rows.items() if self._settled(r)}
        return State(self.units, settled, {w.unit.id: w.doing for w in works}, seconds_left)
