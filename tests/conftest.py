"""Shared fixtures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from tests.forked import Server, in_place_of_subprocess

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it once, when the first test imports it
pytest.register_assert_rewrite(
    "tests.makers.robots.replays"
)  # or a failed assertion there would not tell its numbers


# Files that take longest, by the durations that `make test` ends with: they start first, one worker has each.
LONGEST = (
    "tests/test_chain.py",
    "tests/test_chain_again.py",
    "tests/recon/motion/test_motion.py",
    "tests/test_documents.py",
    "tests/robots/planning/test_tasks.py",
    "tests/twin/collision/test_closed_pieces.py",
    "tests/twin/collision/test_collision.py",
    "tests/twin/completion/test_completion.py",
    "tests/recon/simulate/test_simulate.py",
    "tests/benchmarks/test_mutants.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, all others in their order."""
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.nodeid.partition("::")[0], len(place)))


@pytest.fixture(scope="session")
def funtwin_data() -> Path:
    """Folder with recordings, real tracks and forces, named by $FUNTWIN_DATA; skips when it is not there."""
    folder = os.environ.get("FUNTWIN_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("FUNTWIN_DATA does not name a folder with the measured recordings")
    return Path(folder)


@pytest.fixture(scope="session")
def _server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


@pytest.fixture(autouse=True)
def _forked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, _server: Server) -> None:
    """Engines are asked in forks, with the mark `started` in processes that are started."""
    if request.node.get_closest_marker("started") is None:
        for module in ("twin.verification.process", "twin.lint.simulate"):
            monkeypatch.setattr(import_module(module), "subprocess", in_place_of_subprocess(_server))
