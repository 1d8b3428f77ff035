"""What a recording holds and what its reconstruction takes: length, motions, minutes, memory."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from recon.inspection.finding import Inspection
from recon.inspection.outlook import Outlook, cost, outlook
from recon.readers import open_recording
from recon.recording import Recording
from twin.cli import main as cli
from twin.files.assets import asset

SHIPPED = str(asset("recordings/cabinet_drawer"))


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_recording(SHIPPED)


def repeated(recording: Recording, rests: int, times: int) -> Recording:
    """The recording so many times in a row, there and back, with so many frames of rest in between."""
    n = len(recording)
    order = [
        i
        for k in range(times)
        for i in ([*range(n)] if k % 2 == 0 else [*range(n - 1, -1, -1)])
        + [n - 1 if k % 2 == 0 else 0] * rests
    ]
    return replace(
        recording,
        times=np.arange(len(order)) / 15.0,
        read_color=lambda i: recording.color(order[i]),
        read_depth=lambda i: recording.depth(order[i]),
    )


def test_length_and_motions_of_one_clip(recording: Recording) -> None:
    found = outlook(recording)
    assert found.seconds == pytest.approx(87 / 15, abs=0.01)
    assert found.motions == 1
    assert found.text.startswith("6 s long, 1 motion seen; a reconstruction takes about 0.")
    assert "--start" not in found.text
    assert found.as_dict()["motions"] == 1


def test_each_motion_of_a_long_one_is_counted(recording: Recording) -> None:
    assert outlook(repeated(recording, 30, 3)).motions == 3


def test_two_minutes_are_told_to_take_much_and_to_be_cut() -> None:
    minutes, memory = cost(1800, 640 * 480)
    assert 5 < minutes[0] < 15 < minutes[1] < 120
    assert memory > 20_000
    text = Outlook(120.0, 9, minutes, memory).text
    assert text.startswith("120 s long, 9 motions seen; a reconstruction takes about 9 to")
    assert f"{memory / 1000:.1f} GB of memory" in text
    assert "take the piece with one motion, with --start and --end" in text


def test_what_is_measured_lies_in_between() -> None:
    """Shipped: 35 s on one machine; a kitchen: 55 s and 75 s on two; memory 1.4 and 1.5 GB."""
    for frames, pixels, seconds, memory in (
        (88, 480 * 360, (35,), 1385),
        (124, 640 * 480, (55, 75), 1486),
        (352, 480 * 360, (), 1561),
    ):
        minutes, told = cost(frames, pixels)
        assert all(60 * minutes[0] < s < 60 * minutes[1] for s in seconds)
        assert told == pytest.approx(memory, rel=0.35)


def test_where_nothing_can_be_followed_the_motions_are_not_known() -> None:
    flat = Recording.from_arrays(
        np.full((30, 72, 96, 3), 90, np.uint8),
        np.full((30, 72, 96), 2.0, np.float32),
        np.array([[80.0, 0, 47.5], [0, 80, 35.5], [0, 0, 1]]),
        fps=15,
    )
    found = outlook(flat)
    assert found.motions is None
    assert "motions not known" in found.text


def test_the_verb_tells_it_in_words_and_in_its_document(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = Outlook(6.0, 2, (0.5, 1.25), 1400)
    found = Inspection("clip", (), ("clock",), (), 88, 88, seen)
    monkeypatch.setattr("recon.inspection.inspect.inspect", lambda _: found)
    assert cli.run(["inspect", SHIPPED]) == 0
    assert seen.text in capsys.readouterr().out.splitlines()
    assert cli.run(["inspect", SHIPPED, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["outlook"]
    assert told == {"seconds": 6.0, "motions": 2, "minutes": [0.5, 1.25], "memory_mb": 1400}
