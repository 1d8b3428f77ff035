"""Every finding in models that others made was judged by a person; none is new and none is lost."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from twin.engines import engine
from twin.lint import lint
from twin.lint.rules import RULES

LIST = Path(__file__).parent / "lint_third_party.toml"
MODELS = tomllib.loads(LIST.read_text(encoding="utf-8"))["model"]

# What a program refuses is an error, whatever other programs make of it.
REFUSED = ("refused", "joint-target", "inertia-positive")


def located(model: dict[str, Any]) -> Path:
    """The file in its installed package; skips where that is not installed."""
    if name := model.get("environment"):
        if not engine(name).installed:
            pytest.skip(f"the environment of engine {name!r} is not installed")
        (folder,) = engine(name).folder.glob(f"lib/python*/site-packages/{model['package']}")
    else:
        spec = find_spec(model["package"])
        if spec is None or not spec.submodule_search_locations:
            pytest.skip(f"package {model['package']!r} is not installed")
        folder = Path(spec.submodule_search_locations[0])
    return folder / model["path"]


def marked(model: dict[str, Any]) -> Any:
    slow = [pytest.mark.slow] if model.get("slow") or model.get("environment") else []
    return pytest.param(model, id=model["name"].replace(" ", "-"), marks=slow)


@pytest.mark.parametrize("model", list(map(marked, MODELS)))
def test_findings_are_those_that_were_judged(model: dict[str, Any]) -> None:
    left = list(lint([located(model)]).findings)
    for listed in model.get("finding", []):
        same = [f for f in left if f.rule == listed["rule"] and fnmatchcase(f.element, listed["element"])]
        assert len(same) == listed.get("count", 1), (listed, same)
        if listed["judgement"] == "by design" and listed["rule"] not in REFUSED:
            assert {f.severity for f in same} == {"warning"}, "an error is surely wrong"
        left = [f for f in left if f not in same]
    assert not left, "findings that nobody has judged"


def test_the_list_is_whole() -> None:
    assert len([m for m in MODELS if not m.get("environment")]) >= 5
    for model in MODELS:
        assert set(model) <= {"name", "package", "path", "environment", "slow", "finding"}
        for listed in model.get("finding", []):
            assert listed["rule"] in RULES
            assert listed["judgement"] in ("fault", "by design")
            assert listed["because"]
