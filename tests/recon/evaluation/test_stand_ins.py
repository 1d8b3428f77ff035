"""Recordings on which a reconstruction goes wrong, one cause each: whatever comes out, nothing wrong is
called trusted.

Drawn from open seeds, rendered at half size. They say that a failure is told, not that it is mended.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from recon.evaluation.outcome import outcome
from recon.evaluation.read_truth import load_truth
from recon.simulate import simulate_random
from recon.simulate.random.strata import Stratum
from twin.cli.main import run
from twin.storage import load

SMALL = {"width": 320, "height": 240}
CAUSES = {
    "drifting_background": (31, Stratum("ideal"), {"samples": 1, "textures": 0.4}),
    "a_part_that_fills_the_view": (32, Stratum("structured_light", view="near"), {}),
    "a_pitched_camera": (33, Stratum("structured_light", view="steep"), {}),
    "a_carried_cup": (34, Stratum("structured_light", negative="carried"), {}),
    "noise_like_a_real_sensors": (35, Stratum("stereo"), {}),
    "intrinsics_one_per_cent_off": (36, Stratum("structured_light"), {"picture": {"focal_error": 0.01}}),
    "depth_like_a_phones": (37, Stratum("phone_lidar"), {}),
    "hands_that_touch_nothing": (38, Stratum("time_of_flight", negative="gestures"), {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_nothing_wrong_is_trusted(cause: str, tmp_path: Path) -> None:
    seed, stratum, settings = CAUSES[cause]
    recording = simulate_random(seed, tmp_path / "clip", stratum, SMALL | settings)
    code = run(["reconstruct", str(recording), "-o", str(tmp_path / "run"), "--json"])
    if code == 1:  # the cameras are lost, and that is said
        return
    twin = load(tmp_path / "run")
    found = outcome(twin, load_truth(recording / "truth"))
    assert twin.verdict is not None
    assert [p.cause for p in found.parts if p.trusted and p.cause is not None] == []
    assert not any(found.invented)
    right = all(p.cause is None for p in found.parts) and not found.invented
    assert code == (0 if twin.verdict.level == "trusted" else 2)
    assert right or code == 2
