"""The judge of completed assets: an exact one is whole and holds, and each planted fault is told by its
figure and no other."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from benchmarks.completed import asset as assets
from benchmarks.completed import sight
from benchmarks.completed.asset import STATIC, Asset, load_asset, merged
from benchmarks.completed.balls import balls_kept, dropped
from benchmarks.completed.counts import counts
from benchmarks.completed.handle import called_assumed, section, true_bar
from benchmarks.completed.judge import judge
from benchmarks.completed.page import table
from benchmarks.completed.sight import Sight, front_of, see_through
from benchmarks.completed.surfaces import (
    covered,
    inferred_areas,
    is_closed,
)
from benchmarks.scenes.boards import Board
from benchmarks.scenes.furniture import mesh_of
from recon.evaluation.truth import Truth
from recon.simulate.random.boards import box
from tests.makers.benchmarks.completed import (
    BAR,
    BODIES,
    FLOOR,
    TWIN,
    Geom,
    T,
    drawn,
    without,
    write_run,
)
from twin import geometry as geo
from twin.errors import InputError
from twin.exporters import export
from twin.inferred import Basis, Completion, Inferred
from twin.scene import Mesh
from twin.storage import save

CARCASS = TWIN.static.mesh


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


@pytest.mark.parametrize(("bar", "post"), [("assumed", "evidence"), ("evidence", "assumed")])
def test_a_handle_is_called_assumed_where_its_bar_is(
    truth: Truth, tmp_path: Path, bar: Basis, post: Basis
) -> None:
    """Whatever its posts are, which stand elsewhere."""
    true = true_bar(truth.parts[1], grip(truth, 1))
    assert true is not None
    stands = Board(
        (BAR.low[0], BAR.high[1], BAR.low[2]), (BAR.low[0] + 0.01, BAR.high[1] + 0.02, BAR.high[2])
    )
    geoms = [*drawn(BODIES["drawer"][:5]), Geom("inferred_handle", BAR), Geom("inferred_handle_post", stands)]
    asset = spoilt(tmp_path, {"drawer": geoms})
    plain = TWIN.parts[1].mesh
    pieces = (
        Inferred("handle", "handle", plain, bar, "test"),
        Inferred("handle_post", "handle", plain, post, "test"),
    )
    layer = Completion(plain, pieces)
    assert called_assumed(true, asset.visuals("drawer"), layer) == (bar == "assumed")
    assert not called_assumed(true, asset.visuals("drawer"), None)
    bare = spoilt(tmp_path / "bare", {"drawer": drawn(BODIES["drawer"])})
    assert not called_assumed(true, bare.visuals("drawer"), layer), "nothing inferred stands there"


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
