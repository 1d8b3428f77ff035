"""Laws of a recording of minutes, on a small one: a drawer opened, closed, and opened once more."""

from __future__ import annotations

from pathlib import Path

import pytest

from recon.cameras import submaps
from recon.pipeline import _SECONDS, _SECONDS_OF_WALK, reconstruct
from recon.stages import odometry
from tests.makers.recon.walk import walk_folder
from tests.makers.runs import STAGES, computed, twin_bytes
from twin.files.text import read_json
from twin.storage import load

PER_WINDOW = ("window_noise", "motion", "refine", "labels", "polish")


@pytest.fixture(autouse=True)
def small_submaps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A visit reaches over two."""
    monkeypatch.setattr(submaps, "WHOLE", 50)
    monkeypatch.setattr(submaps, "LENGTH", 40)
    monkeypatch.setattr(submaps, "SHARED", 12)
    monkeypatch.setattr(odometry, "STRETCH", 40)


def stages_of(run: Path) -> list[str]:
    return [s["name"] for s in read_json(run / "manifest.json")["stages"]]


def windows_of(run: Path) -> list[str]:
    return [n.partition("/")[2] for n in stages_of(run) if n.startswith("motion/")]


def without_provenance(run: Path) -> dict[str, bytes]:
    return {k: v for k, v in twin_bytes(run).items() if k != "twin/twin.json"}


def test_a_minute_appended_computes_what_it_touches_and_gives_what_a_fresh_run_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law 4: submaps that end before, and windows in these alone, are kept. Law 3: windows that processes
    solve ahead have the bytes of those that are solved one after the other."""
    monkeypatch.setattr("recon.stages.ahead.threads", lambda: 2)
    recording, run = walk_folder(tmp_path / "walk", 2), tmp_path / "run"
    heard: list[str] = []
    reconstruct(recording, out=run, progress=lambda stage, *_: heard.append(stage))
    assert list(dict.fromkeys(heard)) == list(_SECONDS_OF_WALK)
    before = stages_of(run)
    *_, whole, _ = (n.partition("/")[2] for n in before if n.startswith("submaps/"))
    touched = int(whole[-6:]) - submaps.SHARED  # the last one's frames are others now
    early = [w for w in windows_of(run) if int(w[-6:]) < touched]
    assert early
    walk_folder(recording, 3)
    reconstruct(recording, out=run)
    again = computed(run)
    kept = [f"{stage}/{window}" for stage in PER_WINDOW for window in early] + [
        f"submaps/{whole}",
        "corners/000000-000039",
    ]
    assert set(kept) <= set(before) & set(stages_of(run))
    assert not set(kept) & set(again)
    assert {"frames", "tracks", "cameras", "merge", "fusion"} <= set(again)

    monkeypatch.setattr("recon.stages.ahead.threads", lambda: 1)  # one window after the other
    fresh = tmp_path / "fresh"
    reconstruct(recording, out=fresh)
    assert without_provenance(run) == without_provenance(fresh)
    assert stages_of(run) == stages_of(fresh)
    (part,) = load(run).parts
    assert part.joint.kind == "prismatic"
    assert len(part.motion.intervals) >= 3


def test_the_time_left_of_a_walk_counts_each_of_its_stages() -> None:
    of_windows = {s for s in STAGES if s in PER_WINDOW}
    more = {"frames", "corners", "submaps", "interactions", "recall"}
    assert set(_SECONDS_OF_WALK) == (set(_SECONDS) - of_windows) | more
