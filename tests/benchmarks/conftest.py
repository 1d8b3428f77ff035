"""What the tests of completed assets share: a closed-form cabinet's truth on disk."""

from __future__ import annotations

import pytest

from recon.evaluation.truth import Truth, load_truth
from tests.makers.benchmarks.completed import (
    write_truth,
)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_truth(tmp_path_factory.mktemp("cabinet")))
