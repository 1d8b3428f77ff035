"""What pytest does besides in the copy: it tells each test as it starts and ends, runs them in a given order,
and while the map of the tests is made, says to coverage which test runs."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

LOG, ORDER = "FUNTWIN_MUTANTS_LOG", "FUNTWIN_MUTANTS_ORDER"


def _tell(**said: object) -> None:
    with Path(os.environ[LOG]).open("a", encoding="utf-8") as f:
        f.write(json.dumps(said) + "\n")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files in the order in which they were named; in each the tests of the given order first."""
    if ORDER not in os.environ:
        return
    order = {
        name: k for k, name in enumerate(json.loads(Path(os.environ[ORDER]).read_text(encoding="utf-8")))
    }
    files = {file: k for k, file in enumerate(dict.fromkeys(i.nodeid.split("::")[0] for i in items))}
    items.sort(key=lambda i: (files[i.nodeid.split("::")[0]], order.get(i.nodeid, len(order))))


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Tell that a test starts; what it runs from here on is its own."""
    _tell(start=item.nodeid)
    if ORDER not in os.environ:
        import coverage

        current = coverage.Coverage.current()
        if current is not None:
            current.switch_context(item.nodeid)
    yield


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Tell how a step of a test ended."""
    _tell(test=report.nodeid, outcome=report.outcome, seconds=report.duration)
