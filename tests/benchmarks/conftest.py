"""What the tests of completed assets share: a closed-form cabinet's truth on disk."""

from __future__ import annotations

import pytest

from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from tests.makers.benchmarks.completed import (
    write_truth,
)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_truth(tmp_path_factory.mktemp("cabinet")))
