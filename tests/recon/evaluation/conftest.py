"""A walk and the twin that is exactly it, for all that judges walks."""

from __future__ import annotations

import pytest

from recon.evaluation.truth import Truth
from tests.makers.recon.tiny import twin_of
from tests.makers.recon.walked import walked
from twin.scene import Twin


@pytest.fixture(scope="module")
def truth() -> Truth:
    return walked()


@pytest.fixture(scope="module")
def exact(truth: Truth) -> Twin:
    return twin_of(truth)
