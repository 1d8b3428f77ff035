"""Sealed rates: seeds nobody can know, nothing kept but counters, every run on the page, a stopped run goes
on."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import sealing, unseen, unseen_counts, unseen_page
from benchmarks.scenes.boards import cabinet_twin
from recon.evaluation.outcome import Outcome, PartOutcome, outcome
from recon.evaluation.truth import Truth, TruthPart
from recon.simulate.random.strata import sealed_set
from twin import geometry as geo
from twin.errors import InputError
from twin.scene import Part, Revolute, Trajectory, Twin
from twin.verdict import Verdict, reason
from twin.verdict.verdict import of_twin

GOOD = {"clips": 1, "parts": 1, "success": 1, "trusted": 1, "trusted success": 1}
BAD = {"clips": 1, "parts": 1, "cause axis": 1, "trusted": 1, "failed clips": 1}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(unseen, "STATE", tmp_path / "state")
    monkeypatch.setattr(unseen, "PAGE", tmp_path / "unseen.md")
    monkeypatch.setattr(sealing, "commit", lambda: "abc1234567")
    return tmp_path


def test_sealed_seeds_follow_from_the_commit_and_are_none_of_the_open_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seeds = {sealing.sealed_seed(c, i) for c in ("abc", "abd") for i in range(160)}
    assert len(seeds) == 320
    assert min(seeds) >= sealing.OPEN_SEEDS
    assert sealing.sealed_seed("abc", 3) == sealing.sealed_seed("abc", 3)

    class Least:
        def digest(self) -> bytes:
            return bytes(32)

    monkeypatch.setattr(sealing.hashlib, "sha256", lambda _: Least())
    assert sealing.sealed_seed("abc", 3) == sealing.OPEN_SEEDS


@pytest.mark.parametrize("threads", [1, 2])
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been_stopped(
    bench: Path, monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
    measured: list[int] = []
    stopped: list[bool] = []

    def clip(_: int, index: int, codes: list[Path]) -> list[dict[str, int]]:
        assert len(codes) == 1
        if index == 5 and not stopped:
            stopped.append(True)
            raise RuntimeError("stopped")
        measured.append(index)
        return [GOOD if index % 4 else BAD]

    monkeypatch.setattr(unseen, "_clip_alone", clip)
    with pytest.raises(RuntimeError, match="stopped"):
        unseen.sealed(None)
    assert not (bench / "unseen.md").exists()
    unseen.sealed(None)
    again = [k for k in set(measured) if measured.count(k) > 1]
    assert set(measured) == set(range(160))
    assert set(again) <= set(
        range(6, 11) if threads > 1 else ()
    )  # what was in flight beside the one that stopped
    page = (bench / "unseen.md").read_text()
    assert "| ordinary | 60 | 60 | 45/60 = 75 % [63-84] |" in page
    assert page.count("## abc1234567") == 1
    unseen.sealed(None)  # nothing is left to measure: the row is told again, the earlier one stays
    assert (bench / "unseen.md").read_text().startswith(page.rstrip())


def test_a_baseline_sees_every_fourth_recording_and_has_a_row_of_its_own(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def code(_: str | None) -> Iterator[Path]:
        yield Path("older")

    def clip(_: int, index: int, codes: list[Path]) -> list[dict[str, int]]:
        assert codes[1:] == ([] if index % 4 else [Path("older")])
        return [GOOD, BAD][: len(codes)]

    monkeypatch.setattr(unseen, "_code", code)
    monkeypatch.setattr(unseen, "_clip_alone", clip)
    unseen.sealed("older")
    new, old = (bench / "unseen.md").read_text().split("## ")[1:]
    assert new.startswith("abc1234567\n")
    assert old.startswith("older on clips of abc1234567\n")
    assert "| ordinary | 60 | 60 | 60/60 = 100 %" in new
    assert "| ordinary | 15 | 15 | 0/15 = 0 %" in old
    with pytest.raises(InputError, match="begun with --baseline older"):
        unseen.sealed(None)


def test_only_counters_by_one_factor_are_kept() -> None:
    strata = sealed_set()
    names = {key.partition(": ")[0] for s in strata for key in sealing.counted(GOOD, s)}
    assert all(len(n.split()) in (1, 2, 3) for n in names)
    total = sum((sealing.counted(GOOD, s) for s in strata), start=sealing.counted({}, strata[0]))
    assert [total[f"{g}: clips"] for g in unseen_page.GROUPS] == [60, 60, 40]
    cells = [v for k, v in total.items() if k.endswith(": clips") and not k.startswith("negative ")]
    assert min(cells) >= 8


def test_a_tree_with_changes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        sealing, "git", lambda *words: " M recon/verbs/twins.py" if words[0] == "status" else "abc"
    )
    with pytest.raises(InputError, match="changes that are in no commit"):
        unseen.sealed(None)
    with pytest.raises(InputError, match="not open"):
        unseen.open_clips(9_990, 10_000, Path("out"))


def test_an_interval_holds_its_rate() -> None:
    assert unseen_page.rate(0, 0) == "-"
    assert unseen_page.rate(45, 60) == "45/60 = 75 % [63-84]"


def truth_of(twin: Twin) -> Truth:
    """The truth by which a twin is right in everything; its labels as well."""
    assert twin.cameras is not None
    parts = [
        TruthPart(
            p.id, p.name, p.joint, p.motion.state, p.joint.poses(p.motion.state), p.mesh,
            ((int(p.motion.frames[0]), int(p.motion.frames[-1])),), None,
        )
        for p in twin.parts
    ]  # fmt: skip
    return Truth(
        Path("truth"), len(twin.cameras.frames), twin.cameras, tuple(parts), twin.labels, twin.static.mesh
    )


def seen_twin() -> Twin:
    """A cabinet whose parts all move in view of a camera that walks around."""
    twin = cabinet_twin()
    frames, parts = 12, []
    for part in twin.parts:
        state = np.linspace(part.joint.lower, part.joint.upper, frames)
        motion = replace(
            part.motion,
            frames=np.arange(frames),
            times=np.arange(frames) / 10.0,
            state=state,
            intervals=((0, frames - 1),),
        )
        parts.append(replace(part, motion=motion))
    poses = np.stack(
        [
            geo.make_pose(geo.exp_so3(np.array([0.1 * k, 0.05 * k, 0])), [0.1 * k, -1.0, 0.02 * k])
            for k in range(frames)
        ]
    )
    image = np.ones((20, 30), dtype=np.uint8)
    for k, part in enumerate(parts):
        image[:, 8 * k + 8 : 8 * k + 16] = part.id
    labels = dict.fromkeys(range(0, frames, 3), image)
    return replace(
        twin,
        parts=tuple(parts),
        cameras=Trajectory(np.arange(frames), np.arange(frames) / 10.0, poses),
        labels=labels,
    )


def test_outcomes_name_the_cause_and_count_what_is_invented() -> None:
    twin = seen_twin()
    truth = truth_of(twin)
    right = outcome(twin, truth)
    assert [p.cause for p in right.parts] == [None] * len(twin.parts)
    assert right.invented == ()
    assert right.up_right
    first, *others = twin.parts
    axis = geo.exp_so3(np.deg2rad(6.0) * np.array([1.0, 0.0, 0.0])) @ first.joint.axis
    if geo.line_angle(axis, first.joint.axis) < 1e-3:
        axis = geo.exp_so3(np.deg2rad(6.0) * np.array([0.0, 1.0, 0.0])) @ first.joint.axis
    tilted = replace(first, joint=replace(first.joint, axis=axis, covariance=None))
    assert outcome(replace(twin, parts=(tilted, *others)), truth).parts[0].cause == "axis"
    assert outcome(replace(twin, parts=tuple(others)), truth).parts[0].cause == "missed"
    short, gone = reason("PivotUnsure", "doubtful", 0.01, 0.005), reason("NoSurface", "refused")
    doubted = replace(first, verdict=Verdict((short,)))
    assert outcome(replace(twin, parts=(doubted, *others)), truth).parts[0].doubts == ("PivotUnsure",)
    left_out = of_twin({}, {first.name: Verdict((short, gone))})
    assert outcome(replace(twin, parts=tuple(others), verdict=left_out), truth).refused == ("NoSurface",)
    blind = {k: np.ones_like(v) for k, v in twin.labels.items()}
    assert outcome(replace(twin, labels=blind), truth).parts[0].cause == "labels"
    nothing = replace(truth, parts=())
    assert len(outcome(twin, nothing).invented) == len(twin.parts)
    assert twin.cameras is not None
    far = twin.cameras.T_world_cam.copy()
    far[::2, 0, 3] += 0.2
    lost = replace(twin, cameras=replace(twin.cameras, T_world_cam=far))
    assert outcome(lost, truth).parts[0].cause == "cameras"
    turned = twin.cameras.transformed(geo.make_pose(geo.exp_so3(np.array([0.2, 0, 0]))))
    assert not outcome(replace(twin, cameras=turned), truth).up_right


def test_a_path_that_is_off_says_by_what() -> None:
    twin = seen_twin()
    truth = truth_of(twin)
    assert twin.cameras is not None

    def aside(changed: Twin, k: int) -> tuple[str | None, str | None]:
        return (part := outcome(changed, truth).parts[k]).cause, part.aside

    def changed(k: int, part: Part) -> Twin:
        return replace(twin, parts=(*twin.parts[:k], part, *twin.parts[k + 1 :]))

    k, hinged = next((i, p) for i, p in enumerate(twin.parts) if isinstance(p.joint, Revolute))
    assert isinstance(hinged.joint, Revolute)
    assert aside(twin, k) == (None, None)
    across = geo.orthogonal_basis(hinged.joint.axis)[:, 0]
    moved = replace(hinged.joint, pivot=hinged.joint.pivot + 0.1 * across, covariance=None)
    assert aside(changed(k, replace(hinged, joint=moved)), k) == ("path", "hinge")
    states = hinged.motion.state
    flipped = replace(hinged.motion, state=states.max() - states + states.min())
    assert aside(changed(k, replace(hinged, motion=flipped)), k) == ("path", "closed end")
    short = replace(hinged.motion, state=0.8 * states)
    assert aside(changed(k, replace(hinged, motion=short)), k) == ("path", "states")
    less_than_counts = hinged.joint.pivot + 0.004 * across
    near = replace(hinged.joint, pivot=less_than_counts, covariance=None)
    assert aside(changed(k, replace(hinged, joint=near, motion=short)), k) == ("path", "states")
    drifting = twin.cameras.T_world_cam.copy()
    drifting[::2, 0, 3] += 0.04
    adrift = replace(
        changed(k, replace(hinged, motion=short)), cameras=replace(twin.cameras, T_world_cam=drifting)
    )
    assert aside(adrift, k) == ("path", "cameras")


def test_reasons_are_counted_where_the_verdict_was_wrong() -> None:
    parts = (
        PartOutcome("path", True, aside="hinge"),
        PartOutcome(None, False, ("AxisUnsure", "PivotUnsure")),
        PartOutcome("axis", False, ("AxisUnsure",)),
        PartOutcome("missed", False),
    )
    found = unseen_counts._of_outcome(Outcome(parts, (), True, 2, ("NoSurface",)))
    assert {k for k in found if k.startswith(("doubt ", "refused ", "wrong "))} == {
        "doubt AxisUnsure", "doubt PivotUnsure", "refused NoSurface", "wrong but trusted path of hinge",
    }  # fmt: skip
    assert found["missed where a part was refused"] == 1
    complete = unseen_counts._of_outcome(Outcome(parts[:3], (), True, 2, ("NoSurface",)))
    assert "refused NoSurface" not in complete
    counts = {f"{group}: {k}": n for group in unseen_page.GROUPS for k, n in found.items()}
    page = unseen_page.section("abc", None, 160, counts)
    assert "by cause: path of hinge 3." in page
    assert "by what takes them aside: hinge 3." in page
    assert "by reason: AxisUnsure 3, PivotUnsure 3." in page
    assert "a part was refused: 3; by reason: NoSurface 3." in page


def test_a_clip_that_says_nothing_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    class Done:
        stdout, stderr, returncode = b"Traceback", b"", 9

    def broken(why: str) -> dict[str, int]:
        return {"clips": 1, "broken": 1, f"broken {why}": 1}

    monkeypatch.setattr(sealing.subprocess, "run", lambda *_, **__: Done())
    assert unseen._clip_alone(1, 2, [Path()]) == [broken("output")]
    monkeypatch.setattr(Done, "stdout", b"noise\n" + json.dumps(GOOD).encode())
    assert unseen._clip_alone(1, 2, [Path()]) == [GOOD]
    assert unseen._clip_alone(1, 2, [Path(), Path()]) == [broken("output")] * 2
    monkeypatch.setattr(Done, "stdout", b"")
    assert unseen._clip_alone(1, 2, [Path()]) == [broken("exit 9")]
    told = b"  File x\nnumpy.linalg.LinAlgError: Singular matrix of clip 7\n"
    monkeypatch.setattr(Done, "stderr", told)
    assert unseen._clip_alone(1, 2, [Path()]) == [broken("LinAlgError")]
    assert "without a result, by error: LinAlgError 1." in unseen_page.section(
        "abc", None, 160, {f"negative: {k}": n for k, n in broken("LinAlgError").items()}
    )
    monkeypatch.setattr(
        Done, "stdout", b"noise\n" + json.dumps(GOOD).encode() + b"\n" + json.dumps(BAD).encode()
    )
    assert unseen._clip_alone(1, 2, [Path(), Path()]) == [GOOD, BAD]
