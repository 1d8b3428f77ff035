"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it once, when the first test imports it
pytest.register_assert_rewrite(
    "tests.robots.replays"
)  # or a failed assertion there would not tell its numbers


@pytest.fixture(scope="session")
def funtwin_data() -> Path:
    """Folder with recordings, real tracks and forces, named by $FUNTWIN_DATA; skips when it is not there."""
    folder = os.environ.get("FUNTWIN_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("FUNTWIN_DATA does not name a folder with the measured recordings")
    return Path(folder)
