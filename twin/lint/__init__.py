"""Faults in simulation files that their readers don't report. For any URDF, MJCF or USD file, ours or not.

Readers fill one neutral model (twin.lint.model), rules look at it (twin.lint.rules), and MuJoCo runs it in a
process of its own (twin.lint.simulate). Nothing is repaired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

from twin.errors import InputError, nearest_name
from twin.files.paths import AnyPath
from twin.lint.model import Behaviour, LintModel, Severity
from twin.lint.rules import RULES
from twin.lint.rules.twins import TWIN_RULES
from twin.names import scene_file, several
from twin.storage import load
from twin.storage.document import read_document

SUFFIXES = {".urdf": "urdf", ".usd": "usd", ".usda": "usd", ".usdc": "usd", ".usdz": "usd", ".mjcf": "mjcf"}


@dataclass(frozen=True)
class Finding:
    """One fault: by which rule, how grave, where, the value, what is wrong with it and what to do."""

    rule: str
    severity: Severity
    file: str
    element: str
    value: str
    problem: str
    remedy: str


@dataclass(frozen=True)
class LintReport:
    """Findings of all files in order, and what could not be looked at."""

    files: tuple[str, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True without errors; warnings may be there."""
        return all(f.severity != "error" for f in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {
            "files": list(self.files),
            "findings": [asdict(f) for f in self.findings],
            "notes": list(self.notes),
        }


def lint(paths: AnyPath | Sequence[AnyPath], ignore: str | Sequence[str] = ()) -> LintReport:
    """Look at files, or at all that a run folder exported.

    Args:
        paths: URDF, MJCF or USD files, or run folders with export/.
        ignore: names of rules to leave out.

    Returns:
        what was found. Rules that need the file to run are asked only when no error stands in their way
        (Rule.stops): a wrong limit can't be reached, and one fault shall give one finding.

    Raises:
        InputError: a file can't be read or is none of the formats, a folder holds no export, a rule is not
            known.
    """
    paths = [paths] if isinstance(paths, str | PathLike) else paths
    ignore = several(ignore)
    for name in ignore:
        known = [*RULES, *TWIN_RULES]
        if name not in known:
            close = nearest_name(name, known)
            raise InputError(
                f"rule {name!r} is not known",
                f"did you mean {close!r}?" if close else "see twin lint --rules",
            )
    findings: list[Finding] = []
    notes: list[str] = []
    files = [f for p in paths for f in _files(Path(p))]
    for path in files:
        found, said = _lint_one(path, frozenset(ignore))
        findings += found
        notes += [f"{path}: {s}" for s in said]
    of_twins = [f for p in paths for f in _lint_twin(Path(p), frozenset(ignore))]
    names = dict.fromkeys([*map(str, files), *(f.file for f in of_twins)])
    return LintReport(tuple(names), (*findings, *of_twins), tuple(notes))


def read(path: AnyPath) -> LintModel:
    """Read one file by its format. Raises InputError when it can't be."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist", "give a URDF, MJCF or USD file, or a run folder")
    fmt = SUFFIXES.get(path.suffix.lower())
    if path.suffix.lower() == ".xacro":
        raise InputError(f"{path} is a xacro template", "expand it first: xacro model.xacro > model.urdf")
    if fmt is None or path.suffix.lower() == ".xml":
        if path.suffix.lower() != ".xml":
            raise InputError(f"{path} has a suffix that is not known", f"known: {' '.join(SUFFIXES)} .xml")
        from twin.lint.xml import read_xml

        fmt = "urdf" if read_xml(path)[0].tag == "robot" else "mjcf"
    model: LintModel = import_module(f"twin.lint.{fmt}").read(path)
    return model


def _lint_one(path: Path, ignore: frozenset[str]) -> tuple[list[Finding], list[str]]:
    model = read(path)
    findings = _apply(model, ignore, simulates=False)
    if any(f.severity == "error" and RULES[f.rule].stops for f in findings):
        return findings, ["not run in MuJoCo: the errors come first"]
    from twin.lint.simulate import behaviour

    wanted = [n for n, r in RULES.items() if r.simulates and n not in ignore]
    seen: Behaviour = behaviour(model) if wanted else Behaviour()
    model = replace(model, behaviour=seen)
    return findings + _apply(model, ignore, simulates=True), [
        f"not run in MuJoCo: {seen.skipped}"
    ] if seen.skipped else []


def _lint_twin(path: Path, ignore: frozenset[str]) -> list[Finding]:
    """What is wrong with the twin of a run folder; nothing for a file."""
    folder = path if (path / "twin.json").is_file() else path / "twin"
    if not (folder / "twin.json").is_file():
        return []
    twin = load(folder)
    return [
        Finding(name, f.severity, str(folder / "twin.json"), f.element, f.value, f.problem, f.remedy)
        for name, rule in TWIN_RULES.items()
        if name not in ignore
        for f in rule.find(twin)
    ]


def _apply(model: LintModel, ignore: frozenset[str], simulates: bool) -> list[Finding]:
    return [
        Finding(name, f.severity, str(model.path), f.element, f.value, f.problem, f.remedy)
        for name, rule in RULES.items()
        if rule.simulates == simulates and name not in ignore
        for f in rule.find(model)
    ]


def _files(path: Path) -> list[Path]:
    """The file itself, or the main file of every format that a run folder exported, and the scene of MJCF."""
    if not path.is_dir():
        return [path]
    run = path.parent if path.name == "twin" and (path / "twin.json").is_file() else path
    name = "*"
    if (run / "twin" / "twin.json").is_file():
        try:
            name = str(read_document(run / "twin" / "twin.json")["name"])
        except KeyError as e:
            raise InputError(
                f"{run / 'twin' / 'twin.json'}: {e} is missing", "see docs/twin_format.md"
            ) from e
    found: list[Path] = []
    for fmt, pattern in (("urdf", f"{name}.urdf"), ("mjcf", f"{name}.xml"), ("usd", f"{name}.usd*")):
        files = [f for f in (run / "export" / fmt).glob(pattern) if f.is_file()]
        # beside the main file lie stages for other runtimes, <name>_physx.usda, with their friction
        files.sort(key=lambda f: (len(f.name), f.name))
        scenes = {f: f.with_name(scene_file(f.stem)) for f in files if fmt == "mjcf"}
        whole = [[f, scene] for f, scene in scenes.items() if scene.is_file()]
        found += whole[0] if whole else files[:1]
    if not found:
        raise InputError(f"{path} holds no exported files", "run `twin export` first, or name a file")
    return found
