"""Keys of stages: what a result depends on, and what changed where a key is another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Stage:
    """A stage as the folder that computes it declares it.

    name: identifier, unique in a run. version: to be raised by whoever changes what the stage returns.
    settings: dotted names of the run's settings that it reads ("labels", "motion.clusters").
    """

    name: str
    version: int
    settings: tuple[str, ...]

    def settings_of(self, config: Any) -> Any:
        """What the stage reads of a run's settings: one section as it is, several as a tuple."""
        found = tuple(attrgetter(name)(config) for name in self.settings)
        return found[0] if len(found) == 1 else found


@dataclass(frozen=True)
class Content:
    """What a stage reads that is no stage's result as a whole: a name, and a digest of its content."""

    name: str
    key: str


def digest(*told: Any) -> str:
    """SHA-256 of arrays (type, shape and values), texts and numbers, in their order."""
    out = hashlib.sha256()
    for value in told:
        if isinstance(value, np.ndarray):
            out.update(f"{value.dtype.str}{value.shape}".encode())
            out.update(np.ascontiguousarray(value).data)
        else:
            out.update(f"{value!r};".encode())
    return out.hexdigest()


def stage_key(name: str, parts: Mapping[str, Any]) -> str:
    """SHA-256 of the canonical JSON of a stage's name and key parts."""
    text = json.dumps([name, parts], sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def why_changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """One line that names what differs between two sets of key parts."""
    reasons = []
    if old.get("input") != new["input"]:
        reasons.append("the recording changed")
    if old.get("version") != new["version"]:
        reasons.append(f"the stage's version changed from {old.get('version')} to {new['version']}")
    was, now = _flat(old.get("config")), _flat(new["config"])
    reasons += [
        _what_changed(field, was, now)
        for field in sorted(was.keys() | now.keys())
        if was.get(field) != now.get(field) or (field in was) != (field in now)
    ]
    was, now = old.get("upstream", {}), new["upstream"]
    changed = [n for n in sorted(was.keys() | now.keys()) if was.get(n) != now.get(n)]
    if changed:
        reasons.append(f"it reads {', '.join(changed)}, which changed")
    return "; ".join(reasons) or "its stored key does not match"


def _what_changed(field: str, was: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    if field not in now:
        return f"{field}, which was {was[field]!r}, is no longer a setting"
    if field not in was:
        return f"{field}, which is {now[field]!r}, is a new setting"
    return f"{field or 'config'} changed from {was[field]!r} to {now[field]!r}"


def _flat(config: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(config, list) and any(isinstance(c, Mapping) for c in config):
        config = {str(k): c for k, c in enumerate(config)}
    if not isinstance(config, Mapping):
        return {} if config is None and not prefix else {prefix: config}
    items: dict[str, Any] = {}
    for key, value in config.items():
        items |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return items
