"""A real browser for tests, which skip where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from benchmarks import browser as driver
from benchmarks.browser import Tab as Tab


@contextmanager
def browser(profile: Path, *options: str) -> Iterator[Tab]:
    """A tab of a browser with an empty profile."""
    if reason := driver.missing():
        pytest.skip(reason)
    with driver.browser(profile, *options) as tab:
        yield tab
