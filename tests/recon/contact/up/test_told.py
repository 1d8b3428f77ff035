"""A doubt about up is the twin's first reason, and stands in its provenance for who exports it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from recon import pipeline
from recon.config import ReconConfig
from recon.contact.up.decide import ODDS, Upright, turned
from recon.verdict.completion import Layers
from recon.verdict.judge import Judged
from tests.makers.recon.steep import steep
from twin.level import doubts_about_up
from twin.runs.keys import Stage
from twin.scene import Twin
from twin.verdict import Reason, reason

DOUBT = reason("UpUnsure", "doubtful", 3.0, ODDS, "0.0,-0.7,-0.7", "0.0,-0.7,0.7")
ANOTHER = reason("BareBorder", "doubtful", 3, 0.3, 0.2)


def twin_with(doubt: Reason | None) -> Twin:
    """The twin of a world without parts, of which the verdict has one reason of its own."""
    seen = steep(30.0, with_part=False)
    told: dict[str, Any] = {"contact": (), "texture": {}, "verdict": Judged({}, (ANOTHER,), {})}
    told |= {"handle": {}, "completion": Layers(None, {})}

    class Told:
        run, config = SimpleNamespace(loop=lambda _: None), ReconConfig()

        def __call__(self, what: Stage, *_: object) -> Any:
            return SimpleNamespace(value=told[what.name])

    up = Upright(np.array([0.0, 0.0, 1.0]), doubt)
    doubts = () if doubt is None else (f"{doubt.text}; {doubt.help}",)
    nothing = SimpleNamespace(value={})
    world = turned(seen.world, up.up)
    surveyed = pipeline.Surveyed(world, up, nothing, nothing, (), doubts)  # type: ignore[arg-type]
    made = pipeline._provenance(ReconConfig(), (), surveyed.doubts)
    return pipeline._judged_twin(Told(), seen.recording, surveyed, (), made, {})  # type: ignore[arg-type]


def test_a_doubt_about_up_stands_before_all_others_of_a_twin() -> None:
    verdict = twin_with(DOUBT).verdict
    assert verdict is not None
    assert verdict.reasons == (DOUBT, ANOTHER)
    assert verdict.text.startswith(
        "doubtful: up is unsure: 0.0,-0.7,-0.7 has odds of 3.0 against 0.0,-0.7,0.7"
    )
    assert "--up 0.0,-0.7,-0.7 or --up 0.0,-0.7,0.7" in verdict.text


def test_who_exports_the_twin_is_told() -> None:
    doubts = doubts_about_up(twin_with(DOUBT))
    assert any(DOUBT.text in d and "--up" in d for d in doubts)


def test_a_sure_up_leaves_the_verdict_as_it_is() -> None:
    twin = twin_with(None)
    assert twin.verdict is not None
    assert twin.verdict.reasons == (ANOTHER,)
    assert doubts_about_up(twin) == ()


@pytest.mark.parametrize("other", ["", "0.0,-0.7,0.7"])
def test_what_helps_is_a_word_of_the_users(other: str) -> None:
    assert "--up" in reason("UpUnsure", "doubtful", 1.0, ODDS, "0.0,-0.7,-0.7", other).help
