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


# In which order files start. While test_chain.py has the kernels of a reconstruction compiled and kept on
# disk, the other worker has those of the simulator compiled, and then runs tests that need none. Of those
# that do, the longest come first.
ORDER = (
    "tests/test_chain.py",
    "tests/recon/simulate/",
    "tests/robots/",
    "tests/twin/",
    "tests/test_chain_again.py",
    "tests/test_documents.py",
    "tests/recon/interaction/motion/",
    "tests/recon/interaction/joints/",
)


LONG = frozenset((Path(__file__).parent / "long.txt").read_text(encoding="utf-8").split())


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Those of ORDER first, all others as they come; those of long.txt are marked."""
    for item in items:
        if item.nodeid.partition("[")[0] in LONG:
            item.add_marker(pytest.mark.long)
    items.sort(
        key=lambda item: next((k for k, n in enumerate(ORDER) if item.nodeid.startswith(n)), len(ORDER))
    )


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
