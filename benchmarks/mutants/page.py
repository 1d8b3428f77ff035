"""The page of the results, benchmarks/mutants.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.mutants.faults import Fault
from benchmarks.mutants.run import NOTICED, Result, stands

HEAD = """# Planted faults

Made by `make mutants`: each fault of [mutants/faults.toml](mutants/faults.toml) stands alone in a copy of the tree, and the
default tests that run its line judge it. Rules: a sign turned, a constant times 0.3, a condition dropped (or negated), a term
removed; three or more for every room, drawn by hashes; and the ones named by hand.
"""


def page(faults: Sequence[Fault], results: Mapping[str, Result], root: Path) -> str:
    """The page: a row per room, what survived and why, the named faults, the rate."""
    found = {f.key: results[f.key] for f in faults if f.key in results}
    noticed = [f for f in faults if f.key in found and found[f.key].outcome == NOTICED]
    lines = [HEAD, "| room | faults | noticed | survivors | not judged yet |", "|---|---|---|---|---|"]
    for room in sorted({f.room for f in faults}):
        here = [f for f in faults if f.room == room]
        good, known = (
            sum(f in some for f in here) for some in (noticed, [f for f in here if f.key in found])
        )
        lines.append(f"| `{room}` | {len(here)} | {good} | {known - good} | {len(here) - known} |")
    lines += [
        "",
        "## Survivors",
        "",
        "| file | rule | line | planted | outcome | reason |",
        "|---|---|---|---|---|---|",
    ]
    for f in faults:
        if f.key in found and f not in noticed:
            lines.append(
                f"| `{f.file}` | {f.rule} | {_code(f.line)} | {_code(f.planted)} | {found[f.key].outcome} | {f.reason} |"
            )
    lines += ["", "## Named faults", "", "| fault | file | noticed by |", "|---|---|---|"]
    for f in (f for f in faults if f.name):
        by = found[f.key].by if f in noticed else "nothing" if f.key in found else "not judged yet"
        lines.append(f"| {f.name} | `{f.file}` | {_code(by)} |")
    lines += [
        "",
        f"**{len(noticed)} of {len(found)} planted faults are noticed{_percent(len(noticed), len(found))}.**",
    ]
    older = sum(not stands(root, f, found[f.key]) for f in faults if f.key in found)
    if older or len(found) < len(faults):
        lines.append(
            f"\n{len(faults) - len(found)} faults are not judged yet, {older} were judged on earlier sources or tests."
        )
    return "\n".join(lines) + "\n"


def _code(text: str) -> str:
    return "`" + text.split("  # ")[0].replace("|", "\\|").replace("`", "'") + "`"


def _percent(part: int, whole: int) -> str:
    return f" ({100 * part / whole:.0f} %)" if whole else ""
