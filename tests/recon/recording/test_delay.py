"""Depth that lags is brought back to its colour: in frames, in time, where recordings are opened, and in what
is made of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from recon.evaluation.cut_truth import of_frames
from recon.evaluation.evaluate import evaluate
from recon.evaluation.read_truth import load_truth
from recon.readers import open_recording
from recon.recording import Recording
from tests.makers.recon.in_memory import T, made
from tests.makers.recon.tiny import twin_of, write_recording
from twin.cli.main import run
from twin.errors import InputError


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("delay") / "clip")


def pairs(found: Recording, whole: Recording) -> list[tuple[int, int]]:
    """Frames of `whole` that colour and depth are of."""
    out = []
    for k in range(len(found)):
        color, depth = found.frame(k)
        i = next(i for i in range(len(whole)) if np.array_equal(whole.color(i), color))
        j = next(j for j in range(len(whole)) if np.array_equal(whole.depth(j), depth))
        out.append((i, j))
    return out


def test_colour_gets_the_depth_of_later_frames() -> None:
    whole = made()
    late = whole.without_depth_delay(2)
    assert pairs(late, whole) == [(k, k + 2) for k in range(T - 2)]
    assert late.times.tolist() == whole.times[:-2].tolist()
    early = whole.without_depth_delay(-1)
    assert pairs(early, whole) == [(k, k - 1) for k in range(1, T)]
    assert len({r.fingerprint for r in (whole, late, early, whole[:-2])}) == 4


def test_what_lags_comes_back_as_it_was() -> None:
    whole = made()
    mended = whole.without_depth_delay(-1).without_depth_delay(1)
    assert pairs(mended, whole) == [(k, k) for k in range(1, T - 1)]
    assert whole.without_depth_delay(0) is whole
    assert whole.without_depth_delay("3ms") is whole  # the nearest frame is its own


def test_a_time_takes_the_nearest_frame_and_leaves_out_those_without() -> None:
    times = np.arange(T) / 15.0
    times[6:] += 0.5  # a gap, over which no depth is as late
    whole = made(times=times, fps=None)
    with pytest.raises(InputError, match="leaves 8 of 12"):
        whole.without_depth_delay("133 ms")
    assert pairs(whole.without_depth_delay("66ms"), whole) == [(k, k + 1) for k in range(T - 1) if k != 5]


@pytest.mark.parametrize("wrong", ["soon", "66", 1.5, True, "nanms"])
def test_what_is_no_delay_is_told(wrong: object) -> None:
    with pytest.raises(InputError, match="no depth delay"):
        made().without_depth_delay(wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="leaves 7 of 12 frames"):
        made().without_depth_delay(5)


def test_it_is_an_option_where_recordings_are_opened_and_is_remembered(clip: Path) -> None:
    whole = open_recording(clip)
    opened = open_recording(clip, depth_delay=2, start=0.2)
    assert opened.opened_with == {"depth_delay": 2, "start": 0.2}
    np.testing.assert_array_equal(opened.color(0), whole.color(3))
    np.testing.assert_array_equal(opened.depth(0), whole.depth(5))
    assert (
        open_recording(clip, depth_delay="133ms").fingerprint
        == open_recording(clip, depth_delay=2).fingerprint
    )


def test_it_is_an_option_of_the_verbs(clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k, (words, first) in enumerate(((["2"], (0, 2)), (["-66ms"], (1, 0)))):
        out = tmp_path / str(k)
        assert run(["convert", str(clip), "-o", str(out), "--depth-delay", *words]) == 0
        whole, found = open_recording(clip), open_recording(out)
        np.testing.assert_array_equal(found.color(0), whole.color(first[0]))
        np.testing.assert_allclose(found.depth(0), whole.depth(first[1]), atol=1e-6)
    capsys.readouterr()
    for verb in (
        ["inspect", str(clip)],
        ["reconstruct", str(clip), "-o", str(tmp_path / "r")],
        ["demo", "-o", str(tmp_path / "d")],
    ):
        assert run([*verb, "--depth-delay", "soon"]) == 1
        assert "'soon' is no delay" in capsys.readouterr().err
    assert run(["inspect", str(clip), "--depth-delay", "25", "--json"]) == 1
    assert "leaves 5 of 30 frames" in json.loads(capsys.readouterr().out)["error"]


def test_a_twin_of_some_frames_is_judged_by_their_truth(clip: Path) -> None:
    """Of a recording that was cut, or whose depth lagged."""
    truth = load_truth(clip / "truth")
    some = of_frames(truth, 3, 25)
    assert some.cameras is not None
    assert truth.cameras is not None
    assert some.parts[0].states.tolist() == truth.parts[0].states[3:28].tolist()
    (whole,), (cut,) = truth.parts[0].segments, some.parts[0].segments
    assert cut == (whole[0] - 3, whole[1] - 3)
    np.testing.assert_array_equal(some.labels[0], truth.labels[3])
    np.testing.assert_array_equal(some.cameras.T_world_cam, truth.cameras.T_world_cam[3:28])
    found = evaluate(twin_of(some), truth, open_recording(clip)[3:28])
    rows = {r.metric: r.value for r in found.rows}
    assert rows["axis"] == pytest.approx(0.0, abs=1e-6)
    assert rows["state"] == pytest.approx(0.0, abs=1e-4)
