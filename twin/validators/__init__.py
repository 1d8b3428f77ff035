"""Public validators of USD files: OpenUSD's own, NVIDIA's rules, and NVIDIA's SimReady profile for props.

They check form, not truth: none of them notices a pivot that is off by ten centimetres (twin.check does).
They run in the environment `validators` (see twin.engines), OpenUSD's also in this one.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from twin.engines import interpreter
from twin.errors import InputError

PROFILE = ("Robotics-Prop", "4.0.0")
_SECONDS = 300
_RULES = Path(__file__).with_name("_rules.py")


@dataclass(frozen=True)
class Finding:
    """What a validator has to say about a file; where: a prim or attribute, if it names one."""

    validator: Literal["openusd", "nvidia", "simready"]
    severity: Literal["error", "warning", "info"]
    rule: str
    message: str
    file: str = ""
    where: str = ""


@dataclass(frozen=True)
class UsdVerdict:
    """All findings, and for every feature of the SimReady profile whether it passed."""

    findings: tuple[Finding, ...]
    features: Mapping[str, bool] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[Finding, ...]:
        return tuple(f for f in self.findings if f.severity == "error")

    @property
    def ok(self) -> bool:
        """True when no validator found an error; optional features of the profile may be unmet."""
        return not self.errors

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {
            "ok": self.ok,
            "features": dict(self.features),
            "findings": [asdict(f) for f in self.findings],
        }


def validate_usd(path: Path) -> UsdVerdict:
    """Run all three validators on an export.

    Args:
        path: the main file export/usd/<name>.usda, which stands for all stages beside it and for the asset
            they refer to (the profile judges the asset), or any other USD file.

    Raises:
        InputError: the file is missing, or a validator fails to run.
        MissingDependencyError: they are not installed.
    """
    python = interpreter("validators")
    with _neutral(stages(path)) as files:
        findings = check_rules(files, python)
        told, features = _profile(python, files[-1])
    return UsdVerdict(tuple(findings + told), features)


@contextmanager
def _neutral(files: Sequence[Path]) -> Iterator[list[Path]]:
    """The files of an export in a copy whose folder is called usd: some rules judge every name of a path, and
    what a person calls the folder above is none of the file's faults. A file that is no export may refer to
    others and is judged in place."""
    if len(files) == 1:
        yield list(files)
        return
    root = files[0].parent
    with tempfile.TemporaryDirectory(prefix="usd") as folder:
        copy = Path(folder) / "usd"
        shutil.copytree(root, copy)
        yield [copy / f.relative_to(root) for f in files]


def stages(path: Path) -> list[Path]:
    """The USD files that `path` stands for; the asset's interface is the last."""
    if not path.is_file():
        raise InputError(f"{path} does not exist", "give the main file of an export, export/usd/<name>.usda")
    interface = path.parent / path.stem / "simready_usd" / path.name
    return [*sorted(path.parent.glob("*.usda")), interface] if interface.is_file() else [path]


def check_rules(files: Sequence[Path], python: Path | None = None) -> list[Finding]:
    """Findings of OpenUSD's validators and, where the interpreter has them, NVIDIA's rules.

    python: the interpreter to run them in; by default this one, which has OpenUSD's only.
    """
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [
            str(python or sys.executable),
            str(_RULES),
            str(answer),
            *(str(f.resolve()) for f in files),
        ]
        _run(command, folder, answer)
        return [Finding(**row) for row in json.loads(answer.read_text(encoding="utf-8"))]


def _profile(python: Path, asset: Path) -> tuple[list[Finding], dict[str, bool]]:
    """SimReady's verdict on the interface of an asset: unmet requirements, as errors if the profile's."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        name, version = PROFILE
        command = [
            str(python.with_name("simready-validate")), "--profile", name, "--version", version,
            "--output", str(answer), str(asset.resolve()),
        ]  # fmt: skip
        _run(command, folder, answer)
        (verdict,) = json.loads(answer.read_text(encoding="utf-8")).values()
    findings, features = [], {}
    for feature, told in sorted(verdict["features_summary"].items()):
        features[feature] = bool(told["passed"])
        if not told["passed"]:
            codes = told.get("failing requirements") or told.get("optional requirements") or "unmet"
            text = f"{codes} {told.get('requirement_messages', '')}".strip()
            severity: Literal["error", "info"] = "error" if told["blocking_failure"] else "info"
            findings.append(Finding("simready", severity, feature, text, asset.name))
    return findings, features


def _run(command: list[str], folder: str, answer: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PXR_PLUGINPATH_NAME")}
    try:
        done = subprocess.run(  # noqa: S603  (our own script or the environment's command, no shell)
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired as e:
        raise InputError(f"{Path(command[0]).name} gave no answer within {_SECONDS} s", "try again") from e
    if not answer.is_file():
        said = [x for x in (done.stderr or done.stdout).splitlines() if x.strip()][-1:] or ["it says nothing"]
        raise InputError(
            f"{Path(command[0]).name} failed with exit code {done.returncode}: {said[0]}",
            "install again with `twin engines --install validators`",
        )
