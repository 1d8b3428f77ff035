"""What `twin check` asks of exported files: do engines agree, do parts behave, do validators accept USD."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from twin.contacts import contacts_off
from twin.engines import interpreter
from twin.level import UP, level_evidence
from twin.report.sections import Table
from twin.runs.stages import Progress
from twin.scene import Twin
from twin.validators import UsdVerdict, validate_usd
from twin.verification import OURS, as_exported, behaviour_tables, check, chosen_engines
from twin.verification import tables as check_tables
from twin.verification.behaviour import behave
from twin.verification.config import CheckConfig

VALIDATORS = "validators"


@dataclass(frozen=True)
class Proof:
    """One question with its answer: key and JSON data, a line, tables, notes and warnings."""

    key: str
    ok: bool
    summary: str
    data: Mapping[str, Any]
    tables: Sequence[Table]
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()


def prove(
    progress: Progress,
    twin: Twin,
    files: Mapping[str, Path],
    judges: Sequence[str] | None = None,
    config: CheckConfig | None = None,
) -> list[Proof]:
    """Answer all questions about exported `files` (format -> file).

    judges: names of engines, "validators" for the validators of USD, or "all"; by default the engines that
    come along. Raises InputError, MissingDependencyError: as twin.check and twin.validators.validate_usd.
    """
    names = OURS if judges is None else judges
    engines = chosen_engines([n for n in names if n != VALIDATORS])
    valid = "usd" in files and bool({VALIDATORS, "all"} & set(names))
    if valid:
        interpreter(VALIDATORS)  # told before the engines take their time
    processes = (config or CheckConfig()).processes
    proofs = [_agreement(progress, twin, files, engines, processes)] if engines else []
    proofs.append(_behaviour(progress, as_exported(twin, files), files))
    proofs.append(_contacts(twin))
    proofs.append(_up(twin))
    if valid:
        proofs.append(_validity(progress, files["usd"]))
    return proofs


def _agreement(
    progress: Progress, twin: Twin, files: Mapping[str, Path], engines: Sequence[str], processes: int
) -> Proof:
    progress("check", 0.0, f"loading the files in {', '.join(engines)}")
    report = check(twin, files, engines, processes)
    summary = check_tables.summary(report)
    progress("check", 1.0, summary)
    shown, notes = check_tables.tables(report), check_tables.notes(report)
    return Proof(
        "agreement", report.ok, summary, report.to_dict(), shown, notes, (*report.warnings, *report.notes)
    )


def _behaviour(progress: Progress, twin: Twin, files: Mapping[str, Path]) -> Proof:
    progress("behaviour", 0.0, "moving the parts in MuJoCo")
    report = behave(twin, files)
    summary = behaviour_tables.summary(report)
    progress("behaviour", 1.0, summary)
    shown = behaviour_tables.tables(report)
    return Proof(
        "behaviour", report.ok, summary, report.to_dict(), shown, warnings=(*report.warnings, *report.notes)
    )


def _contacts(twin: Twin) -> Proof:
    """Do the contacts lie on their parts? Every format carries them as they are."""
    stated, off = sum(p.contact is not None for p in twin.parts), contacts_off(twin)
    rows = [[o.part, f"{o.distance:.3f} m", f"{o.allowed:.3f} m", o.remedy] for o in off]
    tables = (
        [Table("contacts off their parts", ["part", "off by", "allowed", "what to do"], rows)] if off else []
    )
    summary = f"{stated - len(off)} of {stated} contacts lie on their parts"
    data = {"ok": not off, "off": [vars(o) for o in off]}
    return Proof("contacts", not off, summary, data, tables, warnings=[o.problem for o in off])


def _up(twin: Twin) -> Proof:
    """Do large planes, slides and hinges agree with the twin's up? If not, a warning: what leans may lean."""
    found = level_evidence(twin)
    rows = [
        [
            w.name,
            "level" if w.level_only else "level or plumb",
            f"{w.off_deg(UP):.2f} deg",
            f"{w.off_deg(found.up):.2f} deg",
        ]
        for w in found.witnesses
    ]
    columns = ["what", "is", "off by the twin's up", f"by an up {found.tilt_deg:.1f} deg away"]
    tables = [Table("up is in doubt", columns, rows)] if found.contradicted else []
    data = {
        "ok": True, "contradicted": found.contradicted, "tilt_deg": found.tilt_deg, "agree": found.agree,
        "witnesses": [{"name": w.name, "off_deg": w.off_deg(UP)} for w in found.witnesses],
    }  # fmt: skip
    return Proof("up", True, found.text, data, tables, warnings=[found.text] if found.contradicted else [])


def _validity(progress: Progress, path: Path) -> Proof:
    progress(VALIDATORS, 0.0, "OpenUSD, NVIDIA, SimReady")
    verdict = validate_usd(path)
    passed = sum(verdict.features.values())
    summary = f"validators of USD: {len(verdict.errors)} errors, {passed} of {len(verdict.features)} SimReady features"
    progress(VALIDATORS, 1.0, summary)
    return Proof(VALIDATORS, verdict.ok, summary, verdict.to_dict(), _findings(verdict))


def _findings(verdict: UsdVerdict) -> list[Table]:
    features = [[name, "passed" if ok else "not met (optional)"] for name, ok in verdict.features.items()]
    rows = [[f.validator, f.severity, f.rule, f.file, f.where, f.message] for f in verdict.findings]
    columns = ["validator", "severity", "rule", "file", "where", "what"]
    found = [Table("findings of USD's validators", columns, rows)] if rows else []
    return [Table("SimReady features", ["feature", ""], features), *found]
