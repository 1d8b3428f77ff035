"""A run of a cabinet, and a live server of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.storage import save
from twin.view import Server, serving


@pytest.fixture
def run(tmp_path: Path) -> Path:
    save(cabinet_twin(), tmp_path / "run" / "twin")
    return tmp_path / "run"


@pytest.fixture
def server(run: Path) -> Iterator[Server]:
    with serving(run) as server:
        yield server
