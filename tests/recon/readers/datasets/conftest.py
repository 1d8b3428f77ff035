"""A tiny recording that every data set's layout is written from, and where its cameras were."""

from __future__ import annotations

from typing import Any

import pytest

import recon
from tests.makers.recon.clips import FRAMES
from tests.makers.recon.tiny import cameras, write_recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> recon.Recording:
    return recon.open_recording(write_recording(tmp_path_factory.mktemp("tiny") / "door", frames=FRAMES))


@pytest.fixture(scope="module")
def T() -> Any:
    return cameras(FRAMES)
