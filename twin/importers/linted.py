"""What `twin lint` calls errors in a file that is imported: in its text, not in how it runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from twin.errors import InputError
from twin.lint import Finding, lint
from twin.lint.rules import RULES

# How a file runs in MuJoCo takes seconds to minutes, and tells of robots and motors that no twin takes.
_TEXT = tuple(name for name, rule in RULES.items() if not rule.simulates)
_NAMED = 3  # elements that one line names


def errors(path: Path, rules: Sequence[str] = _TEXT) -> tuple[str, ...]:
    """A line for each kind of error, in the order of `twin lint`; none for a file that it can't read."""
    try:
        report = lint([path], ignore=[n for n in RULES if n not in rules])
    except InputError:
        return ()
    alike: dict[tuple[str, str, str], list[Finding]] = {}
    for f in report.findings:
        if f.severity == "error":
            alike.setdefault((f.rule, f.problem, f.remedy), []).append(f)
    lines = []
    for (rule, problem, remedy), found in alike.items():
        where = [f"{f.element} ({f.value})" for f in found[:_NAMED]]
        more = [f"{len(found) - _NAMED} more"] if len(found) > _NAMED else []
        lines.append(f"lint, {rule}: {', '.join([*where, *more])}: {problem}; {remedy}")
    return tuple(lines)
