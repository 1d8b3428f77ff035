"""Causes of doubts, of faults, refusals and failures: laws of their tables and of who tells them."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from recon.inspection.findings import FINDINGS, as_reason, finding
from robots.reasons import REASONS as REFUSALS
from robots.reasons import reason as refusal
from twin.cause import Cause, Words
from twin.errors import SceneError
from twin.verdict import REASONS, Verdict, reason, verdict_document, verdict_from

ROOT = Path(__file__).parents[1]
FAMILIES: dict[str, Mapping[str, Words]] = {"reasons": REASONS, "findings": FINDINGS, "refusals": REFUSALS}
TYPES = [(family, name) for family, table in FAMILIES.items() for name in table]
TEXTS = [
    "unit",
    "part",
    "of",
    "said",
    "sort",
    "cure",
    "finding",
    "taken",
    "other",
    "direction",
    "bodies",
    "joint",
    "problem",
    "done",
    "body",
    "stopped",
]
TRUTHS = ("written", "before", "after", "loaded")
PAIRS = {"pressed": ("link5", "door")}


def numbers(words: Words, number: float) -> list[Any]:
    """Numbers of a cause, told by their names."""
    known = {**dict.fromkeys(TEXTS, "door"), **dict.fromkeys(TRUTHS, number > 0), **PAIRS}
    return [known.get(name, number) for name in words.numbers.split()]


def told(family: str, name: str, number: float = 3) -> Cause:
    values = numbers(FAMILIES[family][name], number)
    if family == "reasons":
        return reason(name, "doubtful", *values)
    return (finding if family == "findings" else refusal)(name, *values)


@pytest.mark.parametrize(("family", "name"), TYPES)
def test_every_cause_says_its_numbers_in_one_line(family: str, name: str) -> None:
    for number in (-2, 3, 1.5):
        cause = told(family, name, number)
        assert cause.type == name
        assert cause.text
        assert (cause.help != "") == (family != "refusals")
        for words in (cause.kind, cause.text, cause.help):
            assert not re.search(r"[{}\n]", words)
        assert not re.search(r"(?<![\w.])\d", cause.kind)
        assert cause.kind == told(family, name, 2 * number).kind
        assert json.loads(json.dumps(cause.numbers, allow_nan=False)).keys() == cause.numbers.keys()


@pytest.mark.parametrize(("family", "name"), TYPES)
def test_a_cause_takes_its_numbers_and_only_finite_ones(family: str, name: str) -> None:
    table = FAMILIES[family]
    values = numbers(table[name], 3.0)
    with pytest.raises(ValueError, match="zip"):
        Cause.told(table, name, *values, 1.0)
    for k, value in enumerate(values):
        if isinstance(value, float):
            with pytest.raises(SceneError, match="must be finite"):
                Cause.told(table, name, *values[:k], float("inf"), *values[k + 1 :])


@pytest.mark.parametrize(("family", "name"), [t for t in TYPES if t[0] != "refusals"])
def test_what_a_file_keeps_comes_back(family: str, name: str) -> None:
    cause = told(family, name)
    verdict = Verdict(
        (reason(name, "refused", *numbers(REASONS[name], 3)) if name in REASONS else as_reason(cause),)
    )
    document = json.loads(json.dumps(verdict_document(verdict), allow_nan=False))
    assert verdict_from(document) == verdict


@pytest.mark.parametrize(("page", "table"), [("verdicts", REASONS), ("inspecting", FINDINGS)])
def test_every_cause_is_documented(page: str, table: Mapping[str, Words]) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    assert [name for name in table if f"`{name}`" not in text] == []


def calls() -> Iterator[tuple[str, str, list[ast.expr]]]:
    """(family, type, numbers) of every cause that the product tells by its name."""
    for package in ("twin", "recon", "robots"):
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args):
                    continue
                first = node.args[0]
                if node.func.id in ("reason", "finding") and isinstance(first, ast.Constant):
                    of_twin = node.func.id == "reason" and package != "robots"
                    family = "reasons" if of_twin else "findings" if package == "recon" else "refusals"
                    yield family, str(first.value), node.args[2 if of_twin else 1 :]
                if node.func.id in ("above", "below") and isinstance(first, ast.Constant):
                    _, value, limit, *more = node.args
                    yield "reasons", str(first.value), [*(more or [value]), limit]
                if node.func.id == "_joints_differ" and isinstance(first, ast.Constant):
                    yield "reasons", str(first.value), node.args[1:]


def test_the_product_tells_causes_of_the_tables_and_all_of_them() -> None:
    """Names and numbers are checked when a cause is told, which for most needs a recording that is bad in its
    own way."""
    found = list(calls())
    for family, name, values in found:
        assert name in FAMILIES[family], name
        if not any(isinstance(v, ast.Starred) for v in values):
            assert len(values) == len(FAMILIES[family][name].numbers.split()), name
    assert {(family, name) for family, name, _ in found} == set(TYPES)
