"""The page of sealed rates: a row for each run, added and never taken off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from scipy.stats import binomtest

from recon.evaluation.outcome import Cause

HEAD = """# Recordings that nobody has looked at

`python -m benchmarks.unseen sealed` measures a commit on 160 random recordings (`twin simulate --random`) whose seeds follow from the
commit, deletes each with its run and logs at once, and keeps only counters. Every sealed run stays here. Definitions: docs/metrics.md.
Brackets hold Wilson 95 % intervals. A baseline row is an earlier commit's code on every fourth clip of the same seeds; it has no
verdicts, so all its parts count as trusted.
"""
COLUMNS = (
    "group", "clips", "parts", "success", "trusted", "trusted that succeed", "successes that are trusted", "invented", "doubtful",
    "failed clips with exit 1 or 2", "causes", "up wrong", "broken",
)  # fmt: skip
# of all true parts; a median is below a limit where half of them are
EXACT = (
    "group", "axis ≤ 0.3° / 0.7°", "pivot ≤ 3 / 6 mm", "state ≤ 0.3° or 2 mm / 0.5° or 3 mm",
    "contact ≤ 20 / 60 mm, of the right", "axis within 1 / 2 σ", "pivot within 1 / 2 σ", "states within 1 / 2 σ",
)  # fmt: skip
GROUPS = ("ordinary", "hard", "negative")
CAUSES = get_args(Cause)


def write_row(page: Path, commit: str, baseline: str | None, clips: int, counts: Mapping[str, int]) -> None:
    """Append the tables of one run to the page."""
    text = page.read_text(encoding="utf-8") if page.is_file() else HEAD
    page.write_text(text.rstrip() + "\n\n" + section(commit, baseline, clips, counts), encoding="utf-8")


def section(commit: str, baseline: str | None, clips: int, counts: Mapping[str, int]) -> str:
    """Title and two tables: rates by group, and successes by one factor at a time."""
    title = f"## {commit}" if baseline is None else f"## {baseline} on clips of {commit}"
    rows = [_cells(group, counts) for group in GROUPS]
    head = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    lines = [title, "", f"{clips} clips.", "", *head, *(f"| {' | '.join(r)} |" for r in rows), ""]
    lines += ["| " + " | ".join(EXACT) + " |", "|" + "---|" * len(EXACT)]
    lines += [f"| {' | '.join(_exact(group, counts))} |" for group in GROUPS[:2]]
    lines += ["", *_hands(counts), "", *_reasons(counts), ""]
    lines += ["| factor | parts | success |", "|---|---|---|"]
    for name in sorted({k.partition(": ")[0] for k in counts} - set(GROUPS)):
        parts, good = counts.get(f"{name}: parts", 0), counts.get(f"{name}: success", 0)
        lines.append(f"| {name} | {parts} | {rate(good, parts)} |")
    return "\n".join(lines) + "\n"


def _cells(group: str, counts: Mapping[str, int]) -> list[str]:
    def n(key: str) -> int:
        return counts.get(f"{group}: {key}", 0)

    causes = ", ".join(f"{c} {n('cause ' + c)}" for c in CAUSES if n("cause " + c))
    return [
        group, str(n("clips")), str(n("parts")), rate(n("success"), n("parts")), str(n("trusted")),
        rate(n("trusted success"), n("trusted")), rate(n("trusted success"), n("success")),
        f"{n('invented')}, {n('invented trusted')} trusted", str(n("doubtful")),
        rate(n("exit not 0 where failed"), n("failed clips")), causes or "-", f"{n('up wrong')}, {n('up wrong, told')} told", str(n("broken")),
    ]  # fmt: skip


def _exact(group: str, counts: Mapping[str, int]) -> list[str]:
    """Shares of all true parts, failures counted as beyond; coverage of successes."""

    def n(key: str) -> int:
        return counts.get(f"{group}: {key}", 0)

    def share(what: str, of: int) -> str:
        return " / ".join(_percent(n(f"{what} {word}"), of) for word in ("fine", "good"))

    def held(what: str) -> str:
        of = n(f"{what} components")
        return " / ".join(_percent(n(f"{what} within {k} sigma"), of) for k in (1, 2))

    states = " / ".join(_percent(n(f"states within {k} sigma, ppm"), 1_000_000 * n("states")) for k in (1, 2))
    return [
        group, share("axis", n("parts")), share("pivot", n("hinges")), share("state", n("parts")), share("contact", n("contacts")),
        held("axis"), held("pivot"), states,
    ]  # fmt: skip


def _hands(counts: Mapping[str, int]) -> list[str]:
    """One line on false hands."""
    seen, ppm, many = (
        sum(counts.get(f"{group}: {key}", 0) for group in GROUPS)
        for key in ("hand-free", "hand, ppm", "hand above 3 %")
    )
    mean = f"{ppm / seen / 10_000:.2f} %" if seen else "-"
    return [f"Hand on hand-free frames: mean {mean} of the picture over {seen} clips, above 3 % in {many}."]


def _reasons(counts: Mapping[str, int]) -> list[str]:
    """A line each on what was wrong in spite of trust, right in spite of doubt, and refused where a part was
    missed."""

    def told(word: str) -> str:
        total = Counter[str]()
        for group in GROUPS:
            start = f"{group}: {word} "
            total.update({k.removeprefix(start): n for k, n in counts.items() if k.startswith(start) and n})
        return ", ".join(f"{name} {n}" for name, n in total.most_common()) or "none"

    clips = sum(counts.get(f"{group}: missed where a part was refused", 0) for group in GROUPS)
    return [
        f"- Trusted that fail, by cause: {told('wrong but trusted')}.",
        f"- Paths that are off, by what takes them aside: {told('aside')}.",
        f"- Successes that are doubtful, by reason: {told('doubt')}.",
        f"- Clips with a missed part in which a part was refused: {clips}; by reason: {told('refused')}.",
        f"- Clips without a result, by error: {told('broken')}.",
    ]


def _percent(part: int, of: int) -> str:
    return f"{100 * part / of:.0f} %" if of else "-"


def rate(good: int, of: int) -> str:
    """A rate as text, with its Wilson 95 % interval; "-" of nothing."""
    if of == 0:
        return "-"
    low, high = binomtest(good, of).proportion_ci(method="wilson")
    return f"{good}/{of} = {100 * good / of:.0f} % [{100 * low:.0f}-{100 * high:.0f}]"
