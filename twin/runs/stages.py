"""Stages and the only disk cache: a stage is computed once for one input, one configuration and one version.

The key of a stage is the SHA-256 of its name, its version, its configuration, the keys of the stages read and
the fingerprint of the recording. A result is written to a temporary folder, which is then renamed: whenever
the process dies, what stands under `stages/NN_name` is complete, and the next run goes on from there.
"""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from twin.errors import FuntwinError, InputError, plain
from twin.files.text import read_json, write_json, write_text
from twin.runs.codec import Codec, OtherVersionError, TreeCodec
from twin.runs.keys import Content, stage_key, why_changed
from twin.runs.loop import Loop
from twin.runs.manifest import MANIFEST, update_manifest, versions
from twin.runs.memory import peak_memory_mb, reset_peak_memory
from twin.runs.notes import recording_warnings
from twin.runs.run_lock import claim, release
from twin.runs.settings import as_dict, to_toml

T = TypeVar("T")

CONFIG = "config.toml"
RECORD = "stage.json"


class Progress(Protocol):
    """Told how far a stage is: `fraction` 0..1; `message` says why it runs, or that it was cached."""

    def __call__(self, stage: str, fraction: float, message: str = "") -> None: ...


@dataclass(frozen=True, eq=False)
class StageResult(Generic[T]):
    """Value of a stage with its key, the seconds and the peak memory (MB of the process) of its computation,
    the warnings it gave, whether it was `cached` and, if not, the `reason` to compute it; when that began, s
    since 1970, 0 where that is not known."""

    name: str
    key: str
    value: T
    seconds: float
    peak_mb: float
    warnings: tuple[str, ...]
    cached: bool
    reason: str
    began: float = 0.0


Read = StageResult[Any] | Content


class Run:
    """One reconstruction: a run folder with its cache, or none, in which case all stages are computed.

    Args:
        folder: the run folder, made when missing; None keeps everything in memory.
        fingerprint: identifies the recording's content.
        progress: told about every stage.
        config: of the whole run; written to config.toml for the reader, the stages' own settings decide the
            keys.

    Raises InputError when the folder can't be written or is in use by another process.
    """

    def __init__(
        self, folder: Path | None, fingerprint: str, progress: Progress | None = None, config: Any = None
    ) -> None:
        self.folder = folder
        self.fingerprint = fingerprint
        self.results: list[StageResult[Any]] = []
        self.ahead: dict[str, str] = {}  # what processes of this run computed ahead of it, and why
        self._progress = progress
        self._warnings: list[str] = []
        self._claimed = False
        if folder is not None:
            _make(folder)
            claim(folder)
            self._claimed = True
            try:
                self._prepare(folder, config)
            except BaseException:
                self.close()
                raise

    def _prepare(self, folder: Path, config: Any) -> None:
        for left in list((folder / "stages").glob("**/.*.tmp")):  # what a killed process was writing
            shutil.rmtree(left)
        if not (folder / MANIFEST).exists():  # before all else: it tells that the folder is a run's
            update_manifest(folder, fingerprint=self.fingerprint)
        if config is not None:
            write_text(folder / CONFIG, to_toml(config))

    def stage(
        self,
        name: str,
        version: int,
        config: Any,
        upstream: Sequence[Read],
        compute: Callable[[], T],
        codec: Codec[T] | None = None,
        item: str = "",
        source: str = "",
    ) -> StageResult[T]:
        """The result of `compute`, from the cache if its key is there.

        Args:
            name: identifier, unique in the run with its item.
            version: to be raised by whoever changes what `compute` returns.
            config: dataclass or mapping of all settings that `compute` uses, or None.
            upstream: the results that `compute` reads.
            codec: how to store the value; TreeCodec when None.
            item: what of several the stage is run on, the name of a folder; empty where there is one.
            source: digest of the part of the recording that `compute` reads; empty: all of it.
        """
        name = f"{name}/{item}" if item else name
        if any(r.name == name for r in self.results):
            raise ValueError(f"stage {name!r} was run already; names are unique in a run")
        parts = {
            "version": version,
            "config": as_dict(config),
            "upstream": {u.name: u.key for u in upstream},
            "input": source or self.fingerprint,
        }
        found, reason = self._look_up(name, parts, codec or TreeCodec())
        report = (lambda *_: None) if item else self.report  # whoever goes through the items tells of them
        if found is None:
            report(name, 0.0, reason)
            found = self._compute(name, parts, compute, codec or TreeCodec(), reason)
            report(name, 1.0, f"{found.seconds:.1f} s")
        elif name in self.ahead:
            found = replace(found, cached=False, reason=self.ahead[name])
        else:
            report(name, 1.0, "from the cache")
        self.results.append(found)
        self._write_manifest()
        return found

    def report(self, stage: str, fraction: float, message: str = "") -> None:
        """Pass progress on; for use inside of `compute`."""
        if self._progress is not None:
            self._progress(stage, fraction, message)

    def loop(self, stage: str) -> Loop:
        """A function `(items, what)` that yields the items and reports how many of them are done."""

        def wrap(items: Iterable[T], what: str) -> Iterator[T]:
            total = len(items) if isinstance(items, Sized) else 0
            for k, item in enumerate(items):
                if total:
                    self.report(stage, k / total, what)
                yield item

        return wrap

    def warn(self, message: str) -> None:
        """Note a warning that belongs to no stage (of the recording, for example)."""
        self._warnings.append(message)
        self._write_manifest()

    def forget(self, results: Iterable[StageResult[Any]]) -> None:
        """Free the memory of results that nothing reads any more."""
        gone = {r.name for r in results}
        self.results = [replace(r, value=None) if r.name in gone else r for r in self.results]

    def close(self) -> None:
        """Let other processes use the folder."""
        if self._claimed and self.folder is not None:
            release(self.folder)
            self._claimed = False

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look_up(
        self, name: str, parts: Mapping[str, Any], codec: Codec[T]
    ) -> tuple[StageResult[T] | None, str]:
        """The cached result, or None and the reason why it must be computed."""
        if self.folder is None:
            return None, "no run folder"
        place, stored = self._place(name), self._stored(name)
        if stored is None:
            return None, "not computed yet"
        record = read_json(stored / RECORD)
        key, then = str(record.get("key")), record.get("parts", {})
        if key != stage_key(name, parts):
            return None, why_changed(then, parts)
        try:
            value = codec.load(stored)
            told = float(record["seconds"]), float(record["peak_mb"]), tuple(record["warnings"])
            began = float(record.get("began", 0.0))
        except OtherVersionError as e:
            return None, f"its stored result is of another version of Funtwin: {e.problem}"
        except (FuntwinError, OSError, ValueError, KeyError, TypeError) as e:
            return None, f"its stored result is damaged ({plain(e)})"
        if stored != place:
            place.parent.mkdir(exist_ok=True)
            stored.rename(place)
        return StageResult(name, key, value, *told, True, "", began), ""

    def _compute(
        self,
        name: str,
        parts: Mapping[str, Any],
        compute: Callable[[], T],
        codec: Codec[T],
        reason: str,
    ) -> StageResult[T]:
        began, start, key = round(time.time(), 3), time.perf_counter(), stage_key(name, parts)
        reset_peak_memory()
        value, notes = recording_warnings(compute)
        seconds, peak = time.perf_counter() - start, peak_memory_mb()
        if self.folder is None:
            value = codec.settle(value)
        else:
            record: dict[str, Any] = {"name": name, "key": key, "parts": parts}
            record |= {
                "seconds": round(seconds, 3),
                "peak_mb": round(peak, 1),
                "warnings": notes,
                "began": began,
            }
            self._store(name, value, record, codec)
            value = codec.load(self._place(name))
        return StageResult(name, key, value, seconds, peak, tuple(notes), False, reason, began)

    def _store(self, name: str, value: T, record: Mapping[str, Any], codec: Codec[T]) -> None:
        place = self._place(name)
        temporary = place.with_name(f".{place.name}.tmp")
        temporary.mkdir(parents=True)
        try:
            codec.save(value, temporary)
            write_json(temporary / RECORD, record)
            old = self._stored(name)
            if old is not None:
                old.rename(place.with_name(f".{place.name}.old.tmp"))
            temporary.rename(place)
        except OSError as e:  # a full disk is told without a name
            raise OSError(e.errno, e.strerror, str(place)) from e
        finally:
            for left in (temporary, place.with_name(f".{place.name}.old.tmp")):
                shutil.rmtree(left, ignore_errors=True)

    def _place(self, name: str) -> Path:
        """stages/NN_name, for one of several items stages/NN_name/item; NN counts stages, not items."""
        assert self.folder is not None
        stage, _, item = name.partition("/")
        stages = list(dict.fromkeys([*(r.name.partition("/")[0] for r in self.results), stage]))
        return self.folder / "stages" / f"{stages.index(stage) + 1:02d}_{stage}" / item

    def _stored(self, name: str) -> Path | None:
        """The folder that holds this stage, whatever its number was when it was written."""
        assert self.folder is not None
        stage, _, item = name.partition("/")
        pattern = re.compile(r"\d\d_" + re.escape(stage))
        found = [p / item for p in (self.folder / "stages").iterdir() if pattern.fullmatch(p.name)]
        return min((p for p in found if not item or (p / RECORD).exists()), default=None)

    def _write_manifest(self) -> None:
        if self.folder is None:
            return
        stages = [
            {"name": r.name, "key": r.key, "seconds": round(r.seconds, 3), "peak_mb": round(r.peak_mb, 1)}
            | {"cached": r.cached, "reason": r.reason, "warnings": list(r.warnings), "began": r.began}
            for r in self.results
        ]
        update_manifest(
            self.folder,
            fingerprint=self.fingerprint,
            versions=versions(),
            warnings=list(self._warnings),
            stages=stages,
        )


def _make(folder: Path) -> None:
    """Make a run folder with its cache. InputError: it can't be made or holds somebody else's settings."""
    if (folder / CONFIG).exists() and not (folder / MANIFEST).exists():
        raise InputError(
            f"{folder / CONFIG} is there already and {folder} is no run folder",
            "give a new or empty folder with -o",
        )
    try:
        (folder / "stages").mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(
            f"run folder {folder} can't be written ({e.strerror})", "give another folder with -o"
        ) from e
