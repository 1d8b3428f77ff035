"""Other limits for a part: in the units that people use, and never such that they cut off the motion that was
recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.judged import doubted
from twin.completion import without_shapes
from twin.errors import InputError, SceneError
from twin.exporters import complete
from twin.limits import cut_off
from twin.scene import Motion, Twin
from twin.storage import load, save


def limits(made: Twin, part: str) -> tuple[float, float]:
    joint = made.part(part).joint
    return joint.lower, joint.upper


def test_limits_are_numbers_or_texts_with_a_unit() -> None:
    made = cabinet_twin()
    wider = twin.with_limits(made, "door", lower="-5deg", upper=1.8)
    assert limits(wider, "door") == pytest.approx((np.deg2rad(-5), 1.8))
    assert wider.part("door").limits_source == "stated"
    assert limits(twin.with_limits(made, 3, upper="40 cm"), "drawer") == pytest.approx((0.0, 0.4))
    assert limits(wider, "drawer") == limits(made, "drawer")


def test_limits_that_cut_off_the_recorded_motion_are_refused_by_name() -> None:
    """The door was opened by 1.4 rad: what replays its motion would run into such a limit without a word
    about the cause."""
    told = r"the limits 0\.000\.\.1\.000 rad of part 'door' cut off its recorded motion, which goes from 0\.000 to 1\.4"
    with pytest.raises(SceneError, match=told):
        twin.with_limits(cabinet_twin(), "door", upper=1.0)
    assert limits(twin.with_limits(cabinet_twin(), "door", upper=1.38), "door") == (0.0, 1.38)


def test_such_limits_in_twin_json_are_refused_when_it_is_exported(tmp_path: Path) -> None:
    save(cabinet_twin(), tmp_path)
    file = tmp_path / "twin.json"
    assert '"upper": 1.4' in file.read_text()
    file.write_text(file.read_text().replace('"upper": 1.4', '"upper": 0.7', 1))
    with pytest.raises(
        SceneError, match=r"part 'door' cut off its recorded motion.*; set limits in twin\.json"
    ):
        complete(load(tmp_path))


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"upper": "20cm"}, "upper = '20cm' is no state of part 'door'; give a number in rad, or a text in rad or deg"),
        ({"upper": float("nan")}, "upper = nan is no state"),
        ({"upper": "wide"}, "upper = 'wide' is no state"),
        ({"lower": 0.1}, "can't have the range 0.1..1.4, which does not hold the closed state 0"),
        ({"upper": -1}, "does not hold the closed state 0"),
    ],
)  # fmt: skip
def test_what_is_no_limit_is_told(told: dict[str, float | str], words: str) -> None:
    with pytest.raises((InputError, SceneError), match=words):
        twin.with_limits(cabinet_twin(), "door", **told)


def test_what_depends_on_the_range_is_made_anew() -> None:
    """Shapes keep clear over the whole range, so those of a reconstruction don't hold for another one; stated
    ones stay."""
    scanned = doubted()
    assert twin.with_limits(scanned, "door", upper=1.6).static.collision == ()
    assert all(p.collision for p in twin.with_limits(cabinet_twin(), "door", upper=1.6).parts)
    assert without_shapes(scanned).part("door").collision == ()


def test_a_part_that_nobody_moved_takes_any_range() -> None:
    made = cabinet_twin()
    still = Motion(np.zeros(0, int), np.zeros(0), np.zeros(0))
    parts = (replace(made.parts[0], motion=still), *made.parts[1:])
    assert cut_off(parts[0]) == ""
    assert limits(twin.with_limits(replace(made, parts=parts), "door", upper=0.2), "door") == (0.0, 0.2)
