"""What the verdict's tests ask about: a door that is known well."""

from __future__ import annotations

import pytest

from recon.verdict.evidence import PartEvidence
from tests.makers.recon.altered import with_labels
from tests.makers.recon.cabinets import Clip, make_clip
from tests.makers.recon.judged import perfect


@pytest.fixture(scope="module")
def clip() -> Clip:
    """A door that is opened; modules that need other clips have a fixture of their own."""
    return make_clip("door")


@pytest.fixture(scope="module")
def evidence(clip: Clip) -> PartEvidence:
    """A door about which nothing is doubtful: labelled as what the twin shows there."""
    bare = perfect(clip, {})
    return with_labels(bare, {f: bare.scene.posed.expected(f).owner for f in range(0, 26, 4)})
