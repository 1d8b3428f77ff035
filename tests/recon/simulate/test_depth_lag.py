"""Whole frames of lag of depth, on request: of the same recording otherwise, and of a random stream of their
own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from recon.readers import open_recording
from recon.simulate import simulate
from recon.simulate.config import Staging
from recon.simulate.record import late_depth
from recon.simulate.simulator import MOST_LAG, drawn_lag
from tests.makers.recon.paint import plain_surfaces
from twin.cli.main import run
from twin.errors import InputError
from twin.files.assets import asset

SMALL = Staging(width=48, height=36, frames=24, samples=1, ambient_samples=1, clutter=0, room=False, seed=3)
SCENE = asset("scenes/base_cabinet.xml")


@pytest.fixture(scope="module", autouse=True)
def unpainted() -> Iterator[None]:
    """Nothing here looks at textures."""
    with plain_surfaces():
        yield


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_recording_with_lag_differs_from_that_without_in_the_order_of_its_depth_alone(
    tmp_path: Path,
) -> None:
    plain, late = (
        files(simulate(SCENE, "drawer_top", tmp_path / str(lag), SMALL, depth_lag=lag)) for lag in (0, 2)
    )
    assert json.loads(late.pop("truth/truth.json")) == {
        **json.loads(plain.pop("truth/truth.json")),
        "depth_lag": 2,
    }
    for name, data in late.items():
        folder, _, number = name.partition("/")
        source = name if folder != "depth" else f"depth/{max(int(number[:6]) - 2, 0):06d}.png"
        assert data == plain[source]
    whole = open_recording(tmp_path / "0")
    mended = open_recording(tmp_path / "2", depth_delay=2)
    assert len(mended) == len(whole) - 2
    assert all((mended.depth(k) == whole.depth(k)).all() for k in range(len(mended)))


def test_depth_may_be_ahead_too(tmp_path: Path) -> None:
    (tmp_path / "depth").mkdir()
    for k in range(5):
        (tmp_path / "depth" / f"{k}.png").write_bytes(bytes([k]))
    late_depth(tmp_path, -2)
    assert [p.read_bytes()[0] for p in sorted((tmp_path / "depth").iterdir())] == [2, 3, 4, 4, 4]


def test_a_drawn_lag_is_of_the_seed_and_of_whole_frames() -> None:
    drawn = [drawn_lag(seed) for seed in range(40)]
    assert set(drawn) == set(range(1, MOST_LAG + 1))
    assert drawn == [drawn_lag(seed) for seed in range(40)]


def test_it_is_asked_for_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [f"--set={k}={v}" for k, v in (("width", 48), ("height", 36), ("frames", 24))]
    out = tmp_path / "late"
    argv = ["simulate", str(SCENE), "--joint", "drawer_top", *words, "--set=room=false"]
    assert run([*argv, "-o", str(out), "--depth-lag", "drawn"]) == 0
    assert json.loads((out / "truth/truth.json").read_text())["depth_lag"] == drawn_lag(0)
    assert run([*argv, "-o", str(tmp_path / "b"), "--depth-lag", "soon"]) == 1
    assert "'soon' is no lag" in capsys.readouterr().err
    with pytest.raises(InputError, match="longer than the recording"):
        simulate(SCENE, "drawer_top", tmp_path / "c", replace(SMALL), depth_lag=24)
    assert not (tmp_path / "c").exists()
