"""The check passes what is right although it looks odd, or names the cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin, world_from_cabinet
from benchmarks.scenes.random_twins import random_twin
from twin import geometry as geo
from twin import validators
from twin.exporters import complete, export
from twin.scene import Box, Collision, Inertial, Mesh, Part, Prismatic, Quantity, Revolute, Twin
from twin.verification import check
from twin.verification.behaviour import BehaviourReport, behave
from twin.verification.compare import TOLERANCE, allowed
from twin.verification.rest import hold


def with_stray(mesh: Mesh) -> Mesh:
    """Two vertices three metres away that no face uses."""
    away = np.concatenate([mesh.vertices, mesh.vertices[:2] + 3.0])
    colors = None if mesh.colors is None else np.concatenate([mesh.colors, mesh.colors[:2]])
    return replace(mesh, vertices=away, colors=colors)


def heavier(twin: Twin, factor: float) -> Twin:
    """The twin with all masses and tensors times `factor`."""

    def scaled(part: Part) -> Part:
        assert part.inertial is not None
        mass, own = factor * part.inertial.mass.value, part.inertial
        return replace(
            part, inertial=Inertial(Quantity(mass, "test", (0.0, 1e9)), own.com, factor * own.inertia)
        )

    return replace(twin, parts=tuple(scaled(p) for p in twin.parts))


def leaning(degrees: float) -> Twin:
    """The cabinet leaning forward: door and drawer open by their weight once it is more than friction
    holds."""
    return cabinet_twin(geo.make_pose(geo.exp_so3([np.deg2rad(degrees), 0.0, 0.0]), [0.9, 0.35, 0.15]))


def moved(twin: Twin, way: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Twin:
    T = geo.make_pose(translation=way)

    def shape(piece: Collision) -> Collision:
        return piece.transformed(T) if isinstance(piece, Mesh) else Box(T @ piece.T_world_box, piece.size)

    def part(p: Part) -> Part:
        assert p.inertial is not None
        return replace(
            p, mesh=p.mesh.transformed(T), joint=p.joint.transformed(T), collision=tuple(map(shape, p.collision)),
            inertial=replace(p.inertial, com=p.inertial.com + way), contact=None,
        )  # fmt: skip

    static = replace(twin.static, mesh=twin.static.mesh.transformed(T), collision=())
    return replace(twin, static=static, parts=tuple(map(part, twin.parts)))


def behaves(twin: Twin, folder: Path) -> BehaviourReport:
    return behave(twin, export(twin, folder, ["mjcf"]))


def test_stray_vertices_are_no_surface(tmp_path: Path) -> None:
    twin = cabinet_twin()
    static = replace(twin.static, mesh=with_stray(twin.static.mesh))
    twin = replace(twin, static=static, parts=tuple(replace(p, mesh=with_stray(p.mesh)) for p in twin.parts))
    files = export(twin, tmp_path)
    report = check(twin, files)
    assert (report.warnings, report.failures) == ((), ())
    assert behave(twin, {"mjcf": files["mjcf"]}).ok


@pytest.mark.parametrize("factor", [1e-4, 30.0], ids=["parts of 0.2 g", "a door of 160 kg"])
def test_light_and_heavy_parts_move_as_they_should(factor: float, tmp_path: Path) -> None:
    """An explicit integrator of fixed step broke down on a door's damping at a part of a gram, and never
    ended."""
    twin = heavier(cabinet_twin(), factor)
    report = check(twin, export(twin, tmp_path))
    assert (report.warnings, report.failures) == ((), ())


def test_a_part_too_heavy_for_a_hand_is_told_with_force_and_mass(tmp_path: Path) -> None:
    report = behaves(heavier(cabinet_twin(), 50.0), tmp_path)
    told = {r.part: r.explanation for r in report.failures if r.quantity == "demonstration_m"}
    assert told["drawer"].endswith("at most 50 N, all that a hand gives, with 2.4e+02 kg to move")


@pytest.mark.parametrize("degrees", [4.0, 30.0])
def test_a_part_that_its_weight_opens_moves_as_the_closed_form_says(degrees: float, tmp_path: Path) -> None:
    twin = leaning(degrees)
    held = hold(twin, twin.part("drawer"), 0.0)
    mass = twin.part("drawer").inertial
    assert mass is not None
    assert held.moves
    assert held.pull == pytest.approx(9.81 * mass.mass.value * np.sin(np.deg2rad(degrees)), rel=1e-9)
    files = export(twin, tmp_path, ["urdf", "mjcf", "usd"])
    report = behave(twin, files)
    assert report.failures == ()
    assert {r.format for r in report.rows if (r.part, r.quantity) == ("drawer", "slides_m")} == set(files)
    (note,) = (n for n in report.notes if n.startswith("drawer"))
    assert note == (
        f"drawer: its weight pulls with {held.pull:.2g} N, friction holds 0.3 N: it does not stay closed by itself"
    )
    # a file that holds it, or lets it go faster, is wrong
    text = files["mjcf"].read_text()
    assert 'frictionloss="0.3"' in text
    files["mjcf"].write_text(text.replace('frictionloss="0.3"', 'frictionloss="200"'))
    stuck = behave(twin, {"mjcf": files["mjcf"]})
    assert ("drawer", "slides_m") in {(r.part, r.quantity) for r in stuck.failures}


def test_what_leans_back_or_lies_on_its_stop_stays(tmp_path: Path) -> None:
    twin = leaning(-10.0)
    report = behaves(twin, tmp_path)
    assert (report.failures, report.notes) == ((), ())
    assert hold(twin, twin.part("drawer"), 0.0).text.endswith("a stop holds it")


def test_friction_that_holds_creeps_in_mujoco_and_it_is_said(tmp_path: Path) -> None:
    """A drawer that leans by 0.5 deg is held by friction; MuJoCo's friction is soft and lets it go by 0.9 mm
    in 10 s."""
    twin = leaning(0.5)
    drawer = twin.part("drawer")
    assert drawer.physics is not None
    physics = replace(drawer.physics, frictionloss=Quantity(5.0, "test", (5.0, 5.0)))
    report = behaves(replace(twin, parts=(replace(drawer, physics=physics),)), tmp_path)
    assert (report.failures, report.notes) == ((), ())
    (rest,) = (r for r in report.rows if (r.part, r.quantity) == ("drawer", "rest_m"))
    assert 5e-4 < rest.measured < 1e-3 < rest.limit < 3e-3
    assert "MuJoCo's soft friction yields" in rest.explanation


def test_a_twin_a_kilometre_away_is_judged_by_single_precision(tmp_path: Path) -> None:
    near = random_twin(3, 2)
    twin = moved(near, np.array([700.3, -600.7, 432.1]))
    files = export(twin, tmp_path)
    report = check(twin, files)
    assert (report.warnings, report.failures) == ((), ())
    (note,) = report.notes
    assert "m from its origin: single precision holds 0.061 mm there" in note
    assert check(near, export(near, tmp_path / "near")).notes == ()
    for field in ("pivot_m", "com_m", "motion"):
        assert TOLERANCE[field] < allowed("newton", "usd", field, twin, 0) < 1e-3
        assert allowed("mujoco", "mjcf", field, twin, 0) == TOLERANCE[field]
        assert allowed("newton", "usd", field, near, 0) == 10 * TOLERANCE[field]


def test_a_users_folder_name_is_not_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SimReady judges every name of a path: a run called "My Run 2 ü" failed for that alone."""
    files = export(cabinet_twin(), tmp_path / "My Run 2 ü" / "export", ["usd"])
    seen: list[Path] = []

    def rules(paths: list[Path], _: Path) -> list[validators.Finding]:
        seen.extend(paths)
        assert all(p.is_file() for p in paths)
        return [
            f for f in found(paths) if f.severity == "error"
        ]  # OpenUSD's own, in this environment: references resolve

    def profile(_: Path, asset: Path) -> tuple[list[validators.Finding], dict[str, bool]]:
        seen.append(asset)
        return [], {}

    found = validators.check_rules
    monkeypatch.setattr(validators, "interpreter", lambda _: Path("python"))
    monkeypatch.setattr(validators, "check_rules", rules)
    monkeypatch.setattr(validators, "_profile", profile)
    assert validators.validate_usd(files["usd"]).ok
    assert {p.name for p in seen} == {"cabinet.usda", "cabinet_physx.usda"}
    assert not any("My Run" in str(p) for p in seen)
    assert not any(p.exists() for p in seen), "the copy is gone"


def test_odd_twins_pass(tmp_path: Path) -> None:
    """No moving part; no recording, no contact; a lower limit below zero."""
    twin = cabinet_twin(lid=True)
    still = replace(twin, parts=())
    motion = replace(
        twin.parts[0].motion, frames=np.zeros(0, np.int64), times=np.zeros(0), state=np.zeros(0), intervals=()
    )
    unseen = replace(
        twin, cameras=None, recorded=None, labels={},
        parts=tuple(replace(p, motion=motion, contact=None) for p in twin.parts),
    )  # fmt: skip
    T = world_from_cabinet()
    swing = Revolute(np.array([0.0, 0.0, 1.0]), -0.5, 1.2, pivot=np.array([3.0, 0.0, 0.3])).transformed(T)
    slide = Prismatic(np.array([0.0, -1.0, 0.0]), -0.1, 0.3).transformed(T)
    shift = geo.make_pose(translation=geo.rotate(T, np.array([3.0, -1.0, 0.0])))
    both = tuple(
        replace(
            p, joint=joint, mesh=p.mesh.transformed(shift), contact=None, collision=(),
            inertial=None, physics=None, motion=motion,
        )
        for p, joint in zip(cabinet_twin().parts, (swing, slide), strict=True)
    )  # fmt: skip
    for k, odd in enumerate((still, unseen, complete(replace(cabinet_twin(), parts=both)))):
        files = export(odd, tmp_path / str(k), ["mjcf"])
        report = check(odd, files)
        assert (report.warnings, report.failures) == ((), ())
        assert report.ok
        assert behave(odd, {"mjcf": files["mjcf"]}).failures == ()
