"""Units as Ray tasks: on this machine or on all of a cluster that sees the batch's folder (extra `fleet`).

A task gets paths and gives a small dict: what it carries out is `twin.batch.work`, as without Ray.
"""

from __future__ import annotations

import logging
import os
import shutil
import socket
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from twin import interrupt
from twin.batch.units import Unit
from twin.batch.work import LOOK, SHARE, Limits, Work, machine_mb, row_of
from twin.errors import InputError, MissingDependencyError
from twin.packages import to_install

# MB that a clip of some seconds takes, asked of Ray where nothing else is said (benchmarks/speed.md).
_CLIP_MB = 1500.0
# How often a task is begun again whose node or worker died; of an error of its own never.
_AGAIN = 2
# Tasks that Ray ended for memory are begun again so often, as others may have taken it.
_AGAIN_AFTER_MEMORY = 1


@dataclass
class Task:
    """A unit at work somewhere; driven as `Work` is."""

    unit: Unit
    run: Path
    settings: str
    reference: Any
    verbs: Sequence[str]
    _row: dict[str, Any] | None = None
    _began: float = 0.0

    doing = "in Ray"

    def step(self) -> bool:
        """Whether it is still at work."""
        import ray

        done, _ = ray.wait([self.reference], timeout=0)
        if not done:
            return True
        try:
            self._row = ray.get(self.reference)
        except ray.exceptions.OutOfMemoryError:
            self._row = self._failed("too large for this machine: Ray ended it for memory")
        except ray.exceptions.RayTaskError as e:  # an error of the program; its last line names it
            self._row = self._failed(str(e).strip().splitlines()[-1][:200])
        except ray.exceptions.RayError as e:
            why = str(e).strip().splitlines()[0].partition(". ")[0][:120]
            self._row = self._failed(f"its worker died {1 + _AGAIN} times ({why}); give --retry failed")
        return False

    def stop(self) -> None:
        """End it where it is at work."""
        import ray

        ray.cancel(self.reference, force=True)

    def row(self) -> dict[str, Any]:
        """Its line in the journal."""
        assert self._row is not None
        return self._row

    def _failed(self, error: str) -> dict[str, Any]:
        return {
            "id": self.unit.id, "recording": self.unit.source, "settings": self.settings, "do": list(self.verbs),
            "exit": 1, "verdict": "", "reasons": [], "seconds": round(time.monotonic() - self._began, 1), "peak_mb": 0,
            "host": "", "error": error, "steps": {},
        }  # fmt: skip


@contextmanager
def connected(address: str) -> Iterator[None]:
    """Ray as long as it is needed. address: of a cluster; empty starts one on this machine, also where
    RAY_ADDRESS names another.

    Raises MissingDependencyError without ray, InputError for an address where nobody answers.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is sent anywhere
    os.environ.setdefault("RAY_task_oom_retries", str(_AGAIN_AFTER_MEMORY))
    try:
        import ray
    except ImportError as e:
        raise MissingDependencyError("--backend ray needs ray", to_install("ray", "fleet")) from e
    # sockets lie in there, whose paths have 107 characters at most
    place = None if address else tempfile.mkdtemp(prefix="ray", dir="/tmp")
    local: dict[str, Any] = {} if address else {"include_dashboard": False, "_temp_dir": place}
    try:
        ray.init(address=address or "local", log_to_driver=False, logging_level=logging.ERROR, **local)
    except Exception as e:  # of no class of its own, as where a busy machine does not start it in time
        remedy = "check --address" if address else "try again, or without --backend ray"
        reason = str(e).strip().splitlines()[0][:160]
        raise InputError(f"no Ray cluster answers at {address or 'local'} ({reason})", remedy) from e
    interrupt.handle()  # ray.init takes SIGTERM for itself
    try:
        yield
    finally:
        ray.shutdown()
        if place is not None:
            shutil.rmtree(place, ignore_errors=True)


def places(limits: Limits, asked_mb: float) -> int:
    """How many units the cluster has room for, each with its cores and its memory.

    Raises InputError where no node has room for one, which would wait for ever.
    """
    import ray

    memory = _bytes(asked_mb)
    nodes = [n["Resources"] for n in ray.nodes() if n["Alive"]]
    room = [int(min(n.get("CPU", 0.0) // limits.threads, n.get("memory", 0.0) // memory)) for n in nodes]
    if not any(room):
        most = ", ".join(f"{n.get('CPU', 0):.0f} with {n.get('memory', 0) / 1e9:.1f} GB" for n in nodes)
        raise InputError(
            f"no node has {limits.threads} cores and {memory / 1e9:.1f} GB for a recording; cores here: {most}",
            "give more --workers, which share the cores, or less --memory",
        )
    return sum(room)


def _bytes(asked_mb: float) -> int:
    """Memory that a task asks for."""
    return int(1e6 * (asked_mb or _CLIP_MB))


def begun(work: Work, settings: str, asked_mb: float) -> Task:
    """A unit that Ray carries out. asked_mb: of memory; 0 asks for that of a clip."""
    import ray

    # No max_calls: a unit's program has a process of its own anyway, and with a fresh one of Ray's a unit
    # 8 workers keep 75 % of their time in place of 94 (units of 20 s, two idle cores).
    remote = ray.remote(
        num_cpus=work.limits.threads,
        memory=_bytes(asked_mb),
        max_retries=_AGAIN,
        retry_exceptions=False,
    )(_carried_out)
    told = replace(work, limits=replace(work.limits, memory_mb=asked_mb))
    return Task(
        work.unit, work.run, settings, remote.remote(told, settings), work.verbs, None, time.monotonic()
    )


def _carried_out(work: Work, settings: str) -> dict[str, Any]:
    """On the node: the unit's verbs, watched by limits of this node."""
    limits = work.limits
    if not limits.memory_mb:
        share = limits.threads / len(os.sched_getaffinity(0))
        limits = Limits(limits.seconds, SHARE * machine_mb() * min(1.0, share), limits.threads)
    here = Work(work.unit, work.folder, work.verbs, work.options, limits, work.program)
    try:
        while here.step():
            time.sleep(LOOK)
    finally:
        here.stop()
    return row_of(here, settings, socket.gethostname())
