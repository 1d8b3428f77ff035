"""A tiny recording of a door and a drawer, its own truth, and the twin that is exactly that."""

from __future__ import annotations

import pytest

import recon
from recon.evaluation.read_truth import load_truth
from recon.evaluation.truth import Truth
from tests.makers.recon.annotated import FRAMES, exact_twin
from tests.makers.recon.tiny import write_recording
from twin.scene import Twin


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_recording(tmp_path_factory.mktemp("tiny") / "both", ("door", "drawer"), FRAMES))


@pytest.fixture(scope="module")
def recording(own: Truth) -> recon.Recording:
    return recon.open_recording(own.folder.parent)


@pytest.fixture(scope="module")
def exact(own: Truth) -> Twin:
    return exact_twin(own)
