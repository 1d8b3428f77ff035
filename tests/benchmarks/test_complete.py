"""The judge of completed assets: an exact one is whole and holds, and each planted fault is told by its figure and no other."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from benchmarks import complete, sealing
from benchmarks.completed import asset as assets
from benchmarks.completed import sight
from benchmarks.completed.asset import STATIC, Asset, load_asset, merged
from benchmarks.completed.balls import balls_kept, dropped, inside_of, opens_far
from benchmarks.completed.counts import counts
from benchmarks.completed.handle import section, true_bar
from benchmarks.completed.judge import judge, missed
from benchmarks.completed.page import table
from benchmarks.completed.sight import Sight, front_of, see_through
from benchmarks.completed.surfaces import (
    both_faces_seen,
    covered,
    inferred_areas,
    is_closed,
    rear_share,
    side_share,
)
from benchmarks.scenes.boards import Board
from benchmarks.scenes.furniture import mesh_of
from recon.evaluation.truth import Truth, TruthPart, load_truth
from recon.simulate.random.boards import box
from recon.simulate.random.furniture import KINDS
from recon.simulate.random.strata import sealed_set
from tests.benchmarks.completed import (
    BAR,
    BODIES,
    FLOOR,
    TWIN,
    Geom,
    T,
    drawn,
    without,
    write_run,
    write_truth,
)
from twin import geometry as geo
from twin.errors import InputError
from twin.exporters import export
from twin.inferred import Completion, Inferred
from twin.scene import Mesh
from twin.storage import save

CARCASS = TWIN.static.mesh


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return load_truth(write_truth(tmp_path_factory.mktemp("cabinet")))


@pytest.fixture(autouse=True)
def few_rays() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sight, "SIDE", 60)
        patch.setattr(sight, "STATES", 3)
        yield


def spoilt(folder: Path, bodies: dict[str, list[Geom]] | None = None) -> Asset:
    return load_asset(write_run(folder, bodies), TWIN, np.eye(4))


def grip(truth: Truth, k: int) -> dict[str, Any]:
    return json.loads((truth.folder / "truth.json").read_text())["parts"][k]["grip"]


def looked_at(asset: Asset, truth: Truth, k: int) -> Sight:
    part = truth.parts[k]
    assert truth.cameras is not None
    front = front_of(part.closed_mesh, truth.cameras.T_world_cam)
    found = see_through(asset, part.name, part, CARCASS, truth.static, front)
    assert found is not None
    return found


def test_an_exact_asset_is_exact_in_everything(truth: Truth, tmp_path: Path) -> None:
    judged = judge(write_run(tmp_path / "run"), truth.folder)
    assert [p["part"] for p in judged["parts"]] == ["door", "drawer"]
    for part in judged["parts"]:
        assert part["found"]
        assert part["full"] == part["full, seen layer"] == part["carcass"] == 1.0
        assert part["sight"]["through"] == part["sight"]["inside"] == part["sight"]["deeper"] == 0.0
        assert part["sight"]["rays"] > 1000
        assert [part["handle"][k] for k in ("true", "visual", "collider")] == pytest.approx(
            [0.012] * 3, abs=1e-5
        )
        assert part["handle"]["gap"] == 1.0
        assert part["outside p95, mm"] < 0.01
        assert part["volume ratio"] == pytest.approx(1.0, abs=0.01)
        assert part["open pieces"] == part["open shapes"] == []
        assert part["inferred"] == {}
        assert part["seen"] is None, "no recording lies around the truth"
    assert [p["balls"] for p in judged["parts"]] == [None, 12]
    assert [p["shapes"] for p in judged["parts"]] == [len(BODIES["door"]), len(BODIES["drawer"])]
    assert judged["static"]["shapes"] == len(BODIES["static"])
    found = counts(judged)
    for name in (
        "parts",
        "found",
        "full",
        "handle right",
        "gap free",
        "not seen through",
        "few shapes",
        "outside",
        "ratio",
    ):
        assert found[name] == 2, name
    assert found["drawers"] == found["drawers that hold all"] == 1
    assert found["open pieces"] == found["open shapes"] == 0
    text = table([judged])
    assert text.count("\n") == 5
    assert "12 / 12 / 12" in text
    assert "12 of 12" in text


@pytest.mark.slow
def test_what_the_exporter_writes_of_an_exact_twin_is_exact(truth: Truth, tmp_path: Path) -> None:
    save(TWIN, tmp_path / "twin")
    export(TWIN, tmp_path / "export", ["mjcf"])
    drawer = judge(tmp_path, truth.folder)["parts"][1]
    assert drawer["full"] == drawer["carcass"] == 1.0
    assert drawer["balls"] == 12
    assert drawer["sight"]["through"] == 0.0
    assert drawer["open shapes"] == []


def test_a_drawer_without_floor_holds_nothing_and_lacks_its_surface(truth: Truth, tmp_path: Path) -> None:
    asset = spoilt(tmp_path, without("drawer", FLOOR))
    assert balls_kept(asset, "drawer", truth.parts[1]) == 0
    share = covered(truth.parts[1].closed_mesh, asset.visuals("drawer"))
    area = 2 * FLOOR.size[0] * FLOOR.size[1]
    total = sum(
        2 * (b.size[0] * b.size[1] + b.size[1] * b.size[2] + b.size[2] * b.size[0]) for b in BODIES["drawer"]
    )
    assert 1 - area / total - 0.03 < share < 1 - 0.9 * area / total + 0.03
    assert looked_at(asset, truth, 1).deeper > 0.0


def test_a_drawer_that_is_too_low_to_hold_loses_some(truth: Truth, tmp_path: Path) -> None:
    """Half a floor: only the balls above it stay."""
    half = replace(FLOOR, high=(0.0, *FLOOR.high[1:]))
    asset = spoilt(
        tmp_path, {"drawer": drawn([half, *(b for b in BODIES["drawer"] if b is not FLOOR and b != FLOOR)])}
    )
    assert balls_kept(asset, "drawer", truth.parts[1]) in range(3, 10)


def test_balls_fall_where_the_asset_lies(truth: Truth, tmp_path: Path) -> None:
    """Turned by half a right angle and moved away, the same drawer holds the same balls."""
    turn = geo.make_pose(geo.exp_so3([0.0, 0.0, 0.8]), [2.0, -1.0, 0.4])
    assert TWIN.cameras is not None
    asset = load_asset(_turned_run(tmp_path, turn), TWIN, np.eye(4))
    np.testing.assert_allclose(asset.T_truth_asset, geo.invert_pose(turn), atol=1e-9)
    assert balls_kept(asset, "drawer", truth.parts[1]) == 12
    assert covered(CARCASS, asset.visuals(STATIC)) == 1.0
    joint = TWIN.part("drawer").joint
    np.testing.assert_allclose(asset.moved("drawer", 0.2), joint.pose(0.2), atol=1e-6)
    assert looked_at(asset, truth, 0).through == 0.0


def _turned_run(folder: Path, turn: np.ndarray) -> Path:
    assets.asset_pose = lambda _twin: turn  # type: ignore[assignment]
    return write_run(folder, T_asset_twin=turn)


@pytest.fixture(autouse=True)
def known_origins() -> Iterator[None]:
    before = assets.asset_pose
    yield
    assets.asset_pose = before


def test_an_asset_that_lies_nowhere_known_is_refused(tmp_path: Path) -> None:
    away = geo.make_pose(translation=[0.0, 0.03, 0.0])
    with pytest.raises(InputError, match="from where its twin has it"):
        load_asset(write_run(tmp_path, T_asset_twin=away), TWIN, np.eye(4))
    with pytest.raises(InputError, match="twin export"):
        load_asset(tmp_path / "none", TWIN, np.eye(4))


def test_one_sees_through_a_removed_side_and_into_it(truth: Truth, tmp_path: Path) -> None:
    left, right = BODIES["static"][:2]
    whole = looked_at(spoilt(tmp_path / "a"), truth, 1)
    one = looked_at(spoilt(tmp_path / "b", without("static", left)), truth, 1)
    both = looked_at(spoilt(tmp_path / "c", without("static", left, right)), truth, 1)
    assert whole.rays == one.rays == both.rays
    assert whole.through == 0.0
    assert 0.0 < one.inside <= one.through < both.through
    assert one.deeper > one.through


def test_a_ray_counts_only_where_nothing_stands_before_the_furniture(truth: Truth, tmp_path: Path) -> None:
    asset, part = spoilt(tmp_path), truth.parts[1]
    screen = Board((-2.0, -0.8, -2.0), (2.0, -0.7, 3.0)).box(T)
    behind = mesh_of([screen])
    assert see_through(asset, "drawer", part, CARCASS, merged([CARCASS, behind]), -T[:3, 1]) is None


def test_a_kept_room_is_no_furniture(truth: Truth, tmp_path: Path) -> None:
    """It neither covers a missing board, nor hides that one sees through, nor counts as shapes."""
    left, right = BODIES["static"][:2]
    wall = Board((-3.0, 0.5, -2.0), (3.0, 0.6, 3.0))
    bodies = {**without("static", left, right), "room": drawn([wall, left])}
    kept, dropped_ = (
        spoilt(tmp_path / "kept", bodies),
        spoilt(tmp_path / "dropped", without("static", left, right)),
    )
    assert looked_at(kept, truth, 1) == looked_at(dropped_, truth, 1)
    assert covered(CARCASS, kept.visuals(STATIC)) == covered(CARCASS, dropped_.visuals(STATIC)) < 1.0
    assert len(kept.colliders(STATIC)) == len(BODIES["static"]) - 2


def test_a_part_of_which_nothing_is_left_has_figures_all_the_same(truth: Truth, tmp_path: Path) -> None:
    asset, part = spoilt(tmp_path, {"drawer": []}), truth.parts[1]
    assert covered(part.closed_mesh, asset.visuals("drawer")) == 0.0
    assert balls_kept(asset, "drawer", part) == 0
    assert looked_at(asset, truth, 1).through > 0.0
    bar = true_bar(part, grip(truth, 1))
    assert bar is not None
    found = section(bar, part, [], [])
    assert (found.visual, found.collider, found.gap) == (0.0, 0.0, 1.0)


def test_the_asset_is_brought_to_the_truth(tmp_path: Path) -> None:
    there = geo.make_pose(geo.exp_so3([0.3, -0.2, 1.0]), [1.0, 2.0, 3.0])
    asset = load_asset(write_run(tmp_path), TWIN, there)
    shown = merged(g.mesh for g in asset.visuals(STATIC))
    np.testing.assert_allclose(
        shown.area_centroid, geo.transform(there, CARCASS.area_centroid[None])[0], atol=1e-6
    )
    turned = there @ TWIN.part("door").joint.pose(0.7) @ geo.invert_pose(there)
    np.testing.assert_allclose(asset.moved("door", 0.7), turned, atol=1e-6)


def test_an_opened_drawer_is_held_while_balls_roll(tmp_path: Path) -> None:
    """Under a pull that would shut it, the balls come to rest at the back of the drawer as it stands open."""
    asset = spoilt(tmp_path)
    pull = T[:3, :3] @ np.array([0.0, 5.0, -8.0])
    spec = mujoco.MjSpec.from_file(str(asset.path))
    spec.option.gravity = pull
    spec.compile()
    asset.path.write_text(spec.to_xml())
    state, back = 0.30, BODIES["drawer"][4].low[1]
    start = geo.transform(T, np.array([[x, -0.1, 0.70] for x in (-0.1, 0.0, 0.1)]))
    end = geo.transform(geo.invert_pose(T), dropped(asset.path, asset.joint("drawer"), state, start))
    np.testing.assert_allclose(end[:, 1], back - state - 0.02, atol=0.003)


def test_an_outline_that_is_a_little_off_is_seen_through_only_at_the_rim(
    truth: Truth, tmp_path: Path
) -> None:
    top = BODIES["static"][3]
    lower = replace(top, high=(*top.high[:2], top.high[2] - 0.006))
    low = [Board(b.low, (*b.high[:2], min(b.high[2], lower.high[2]))) for b in BODIES["static"]]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sight, "SIDE", 200)
        found = looked_at(spoilt(tmp_path, {"static": drawn(low)}), truth, 0)
    assert found.through > 0.0
    assert found.inside == 0.0


@pytest.mark.parametrize("what", ["visual", "collision"])
def test_a_handle_of_double_thickness_is_told(truth: Truth, tmp_path: Path, what: str) -> None:
    thick = Board(tuple(np.array(BAR.low) - [0, 0.006, 0.006]), tuple(np.array(BAR.high) + [0, 0.006, 0.006]))
    k = BODIES["drawer"].index(BAR)
    geoms = [Geom(g.name, thick) if g.name == f"{what}_{k}" else g for g in drawn(BODIES["drawer"])]
    asset, part = spoilt(tmp_path, {"drawer": geoms}), truth.parts[1]
    bar = true_bar(part, grip(truth, 1))
    assert bar is not None
    found = section(bar, part, asset.visuals("drawer"), asset.colliders("drawer"))
    spoilt_one, other = (found.visual, found.collider) if what == "visual" else (found.collider, found.visual)
    assert spoilt_one == pytest.approx(0.024, abs=1e-5)
    assert other == pytest.approx(found.true, abs=1e-5)
    assert found.gap == (1.0 if what == "visual" else pytest.approx(1 - 6 / 34, abs=0.02))


def test_a_handle_that_is_filled_or_missing_is_told(truth: Truth, tmp_path: Path) -> None:
    part = truth.parts[1]
    bar = true_bar(part, grip(truth, 1))
    assert bar is not None
    front = BODIES["drawer"][0]
    block = Board(BAR.low, (BAR.high[0], front.low[1], BAR.high[2]))
    solid = spoilt(tmp_path / "solid", {"drawer": drawn([*BODIES["drawer"], block])})
    found = section(bar, part, solid.visuals("drawer"), solid.colliders("drawer"))
    assert found.gap == 0.0
    assert found.collider > 0.02
    bare = spoilt(tmp_path / "bare", {"drawer": drawn(BODIES["drawer"][:5])})
    found = section(bar, part, bare.visuals("drawer"), bare.colliders("drawer"))
    assert (found.visual, found.collider, found.gap) == (0.0, 0.0, 1.0)


def test_a_bare_edge_has_no_handle(truth: Truth) -> None:
    part, told = truth.parts[0], grip(truth, 0)
    corner = part.mesh.vertices[np.argmax(part.mesh.vertices[:, 2])]
    assert true_bar(part, told | {"point_world": corner.tolist()}) is None


def test_inferred_area_is_judged_by_what_it_rests_on(truth: Truth, tmp_path: Path) -> None:
    off = Board((FLOOR.low[0], FLOOR.low[1], FLOOR.low[2] + 0.05), (*FLOOR.high[:2], FLOOR.high[2] + 0.05))
    seen = [b for b in BODIES["drawer"] if b != FLOOR]
    geoms = [
        *drawn(seen),
        Geom("inferred_floor", FLOOR),
        Geom("inferred_shelf", off),
        Geom("inferred_thing", off),
    ]
    asset = spoilt(tmp_path, {"drawer": geoms})
    plain = TWIN.parts[1].mesh
    pieces = (
        Inferred("floor", "floor", plain, "evidence", "seen from above"),
        Inferred("shelf", "shelf", plain, "assumed", "usual"),
    )
    found = inferred_areas(asset.visuals("drawer"), Completion(plain, pieces), truth.parts[1].closed_mesh)
    assert {k: a.off for k, a in found.items() if k == "evidence"} == {"evidence": 0.0}
    assert found["assumed"].off == found["unnamed"].off > 0.6, "but for its rim beside the walls"
    size = FLOOR.size
    assert found["evidence"].area == pytest.approx(
        2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]), rel=1e-5
    )
    assert covered(truth.parts[1].closed_mesh, asset.visuals("drawer")) == 1.0
    assert (
        covered(truth.parts[1].closed_mesh, [g for g in asset.visuals("drawer") if g.inferred is None]) < 0.85
    )


def test_a_mesh_is_closed_where_every_edge_has_two_faces_that_turn_alike() -> None:
    whole = mesh_of([box([0, 0, 0], [1, 1, 1]), box([3, 0, 0], [1, 1, 1])])
    assert is_closed(whole)
    soup = whole.vertices[whole.faces].reshape(-1, 3)
    assert is_closed(Mesh(soup, np.arange(len(soup), dtype=np.int32).reshape(-1, 3))), (
        "corners at one place are one"
    )
    assert not is_closed(Mesh(whole.vertices, whole.faces[1:]))
    assert not is_closed(Mesh(whole.vertices, np.concatenate([whole.faces[:1, ::-1], whole.faces[1:]])))
    assert not is_closed(Mesh(whole.vertices, np.concatenate([whole.faces, whole.faces[:1]])))
    assert not is_closed(Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32)))


@cache
def true_drawer(kind: str, seed: int) -> tuple[TruthPart, Any]:
    made = KINDS[kind](np.random.default_rng(seed), "bar")
    states = np.linspace(0.0, made.joint.upper, 5)
    part = TruthPart(
        2, kind, made.joint, states, made.joint.poses(states), mesh_of(made.part), ((0, 4),), None
    )
    return part, made


@pytest.mark.parametrize("kind", KINDS)
def test_the_inside_of_random_furniture_is_that_of_its_boards(kind: str) -> None:
    for seed in range(4):
        part, made = true_drawer(kind, seed)
        inside = inside_of(part)
        if not kind.startswith("drawer"):
            assert inside is None
            continue
        floor, *sides = made.panels[1:]
        gap = sides[1].corners[:, 0].min() - sides[0].corners[:, 0].max()
        if inside is None:
            assert np.min([gap, floor.size[1]]) < 0.15
            continue
        assert inside.floor == pytest.approx(floor.corners[:, 2].max(), abs=1e-4)
        assert inside.rim == pytest.approx(max(s.corners[:, 2].max() for s in sides), abs=1e-4)
        assert inside.front == pytest.approx(-floor.corners[:, 1].min(), abs=0.003), (
            "which ends 9 mm behind the front"
        )
        np.testing.assert_allclose((inside.high - inside.low)[0], gap, atol=0.005)
        low, high = inside.opened(part.travel)
        assert (high - low)[1] == pytest.approx(part.travel, abs=0.005)
        wide = min(gap, part.travel) >= 0.15 and max(gap, part.travel) >= 0.2
        assert (opens_far(part) is not None) == wide or min(
            abs(min(gap, part.travel) - 0.15), abs(max(gap, part.travel) - 0.2)
        ) < 0.006


def test_the_front_is_the_upright_side_towards_the_camera(truth: Truth) -> None:
    assert truth.cameras is not None
    for part in truth.parts:
        np.testing.assert_allclose(
            front_of(part.closed_mesh, truth.cameras.T_world_cam), -T[:3, 1], atol=1e-6
        )


def test_what_was_seen_is_told_by_its_points(truth: Truth) -> None:
    door, drawer = truth.parts
    rear = drawer.closed_mesh.vertices @ drawer.joint.axis
    back = drawer.closed_mesh.vertices[rear < rear.min() + 0.012]
    along = rear.min() + np.arange(0.0, 0.4, 0.001)[:, None] * 1.0
    assert rear_share(drawer, along * drawer.joint.axis) == pytest.approx(0.03 / 0.4, abs=0.003)
    others = drawer.closed_mesh.vertices[rear > rear.max() - 0.05]
    assert rear_share(drawer, np.concatenate([back, others])) == pytest.approx(
        len(back) / (len(back) + len(others))
    )
    assert rear_share(drawer, others) == rear_share(drawer, np.zeros((0, 3))) == 0.0
    assert rear_share(door, others) is None
    outer = geo.transform(T, _grid(BODIES["door"][0], 1, low=True))
    inner = geo.transform(T, _grid(BODIES["door"][0], 1, low=False))
    assert both_faces_seen(door.closed_mesh, np.concatenate([outer, inner]))
    assert not both_faces_seen(door.closed_mesh, outer)
    outward = -T[:3, 1]
    faces = np.concatenate([geo.transform(T, _grid(b, 1, low=True)) for b in BODIES["static"]])
    assert side_share(CARCASS, outward, faces) < 0.12, "their edges alone"
    flank = geo.transform(T, _grid(BODIES["static"][0], 0, low=True))
    assert side_share(CARCASS, outward, flank) > 0.1


def _grid(board: Board, axis: int, low: bool) -> np.ndarray:
    """Points every 8 mm of one side of a board, in the cabinet's frame."""
    at = [np.arange(a, b + 1e-9, 0.008) for a, b in zip(board.low, board.high, strict=True)]
    at[axis] = np.array([board.low[axis] if low else board.high[axis]])
    return np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 3)


def test_a_part_that_was_not_found_is_charged(truth: Truth) -> None:
    judged = missed(truth.folder)
    found = counts(judged)
    assert found["parts"] == found["handles"] == found["full bin 0"] == 2
    assert found["drawers"] == 1
    assert found["found"] == found["full"] == found["handle right"] == found["drawers that hold all"] == 0
    assert "not found" in table([judged])
    assert [p["carcass"] for p in judged["parts"]] == [0.0, 0.0]


def test_a_handle_is_right_where_it_is_drawn_and_touched_so_and_else_may_say_that_it_is_assumed(
    truth: Truth,
) -> None:
    door = missed(truth.folder)["parts"][0]
    layer = {"inferred": {}, "pieces": 2, "open pieces": ["a"], "shapes": 25, "open shapes": []}
    whole = {
        "full": 0.8,
        "full, seen layer": 0.4,
        "outside p95, mm": 7.0,
        "volume ratio": 1.2,
        "sight": None,
        "balls": None,
    }
    part = {**door, **layer, **whole, "found": True, "rear seen": True, "both faces seen": True}

    def told(visual: float, collider: float, gap: float, assumed: bool) -> dict[str, int]:
        handle = {"true": 0.012, "visual": visual, "collider": collider, "gap": gap}
        one = {**part, "handle": handle, "handle assumed": assumed}
        return dict(counts({"parts": [one], "static": None}))

    names = ("handle right", "handle right or assumed", "handle wrong but assumed", "gap free")
    right, thick, marked = (
        told(0.015, 0.009, 0.7, False),
        told(0.012, 0.017, 0.69, False),
        told(0.017, 0.012, 0.69, True),
    )
    assert [right.get(n, 0) for n in names] == [1, 1, 0, 1]
    assert [thick.get(n, 0) for n in names] == [0, 0, 0, 0]
    assert [marked.get(n, 0) for n in names] == [0, 1, 1, 0]
    bars = (
        "full",
        "full, rear seen",
        "few shapes",
        "outside",
        "ratio",
        "two-faced ratio",
        "open pieces",
        "full bin 80",
    )
    assert [right.get(n, 0) for n in bars] == [1, 0, 0, 0, 1, 0, 1, 1]


def test_the_sealed_clips_are_of_both_groups_and_all_factors() -> None:
    strata = [sealed_set()[i] for i in complete.CLIPS]
    assert len(set(complete.CLIPS)) == 40
    assert Counter(s.group for s in strata) == {"ordinary": 20, "hard": 20}
    for group, sensors in (("ordinary", 3), ("hard", 5)):
        of = Counter(s.sensor for s in strata if s.group == group)
        assert len(of) == sensors
        assert min(of.values()) >= 3
    assert {s.view for s in strata} == {"ordinary", "near", "steep", "moving"}
    assert {s.short for s in strata} == {True, False}


def test_a_sealed_run_keeps_rates_and_goes_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = {
        "clips": 1,
        "with twin": 1,
        "parts": 1,
        "found": 1,
        "full": 1,
        "full bin 80": 1,
        "evidence, cm2": 100,
        "evidence off, cm2": 3,
    }
    bad = {"clips": 1, "parts": 1, "full bin 0": 1}
    broken = {"clips": 1, "broken": 1, "broken time": 1}
    monkeypatch.setattr(complete, "PAGE", tmp_path / "complete.md")
    monkeypatch.setattr(complete, "STATE", tmp_path / "state")
    monkeypatch.setattr(sealing, "commit", lambda: "abc1234567")
    rows = {0: broken, 4: bad}
    monkeypatch.setattr(complete, "_clip_alone", lambda _, i: [rows.get(i, good)])
    assert complete.main(["sealed"]) == 0
    page = (tmp_path / "complete.md").read_text()
    assert page.startswith("# Completed assets")
    assert "## abc1234567\n\n40 clips." in page
    assert "| full surface, of all | ≥ 75 % | 18/19 = 95 % [75-99] | 20/20 = 100 % [84-100] |" in page
    assert "| full surface, median of all |  | 80-85 % of 19 | 80-85 % of 20 |" in page
    assert "| part inferred area off, evidence |  | 3.0 % of 0.18 m² | 3.0 % of 0.20 m² |" in page
    assert "broken time 1" in page
    complete.main(["sealed"])
    assert (tmp_path / "complete.md").read_text().count("## abc1234567") == 2, "no row is taken off"


def test_the_chain_of_a_clip_counts_what_each_step_leaves(
    truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, ...]] = []
    made = {"reconstruct": True, "export": True}

    def simulated(_seed: int, out: Path, _stratum: object) -> None:
        write_truth(out)

    def verb(_code: Path, folder: Path, *words: str) -> int:
        calls.append(words)
        if words[0] == "reconstruct" and made["reconstruct"]:
            write_run(folder / "run")
        return 0 if made[words[0]] else 1

    monkeypatch.setattr(complete, "simulate_random", simulated)
    monkeypatch.setattr(sealing, "twin_verb", verb)
    monkeypatch.setattr(complete, "judge", lambda *_: {"parts": [], "static": None})
    places = [tmp_path / n for n in "abc"]
    assert complete.clip(1, 0, places[0], Path()) == {"clips": 1, "with twin": 1}
    made["export"] = False
    unexported = complete.clip(1, 0, places[1], Path())
    assert (unexported["broken export"], unexported["parts"], unexported.get("found", 0)) == (1, 2, 0)
    made["reconstruct"] = False
    assert "with twin" not in complete.clip(1, 0, places[2], Path())
    assert [c[0] for c in calls] == ["reconstruct", "export", "reconstruct", "export", "reconstruct"]


def test_the_command_line_prints_a_table_and_tells_errors_in_one_line(
    truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = missed(truth.folder)
    monkeypatch.setattr(complete, "judge", lambda *_: told)
    monkeypatch.setattr(complete, "PAGE", tmp_path / "page.md")
    assert complete.main(["run", "truth", "--page", "by hand"]) == 0
    printed = capsys.readouterr().out
    assert "drawer" in printed
    assert printed.strip() in (tmp_path / "page.md").read_text()
    monkeypatch.setattr(complete, "judge", judge)
    assert complete.main([str(tmp_path), str(truth.folder)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(SystemExit):
        complete.main(["run"])
