"""Random twins of all sizes, weights and places: whatever their check says no to is so."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.random_twins import random_twin
from tests.twin.verification.test_false_alarms import moved
from twin.exporters import complete, export
from twin.scene import Box, Collision, Inertial, Mesh, Part, Prismatic, Revolute, Twin
from twin.verification import check
from twin.verification.behaviour import BehaviourRow, behave

SEEDS = 150


def scaled(twin: Twin, factor: float, density: bool = False) -> Twin:
    """All lengths times `factor`; masses stay, unless `density` does. Friction and damping are estimated
    anew."""

    def shape(piece: Collision) -> Collision:
        if isinstance(piece, Mesh):
            return replace(piece, vertices=factor * piece.vertices)
        T = piece.T_world_box.copy()
        T[:3, 3] *= factor
        return Box(T, factor * piece.size)

    def part(p: Part) -> Part:
        own, joint, motion = p.inertial, p.joint, p.motion
        assert own is not None
        if isinstance(joint, Revolute):
            joint = replace(joint, pivot=factor * joint.pivot)
        if isinstance(joint, Prismatic):
            joint = replace(joint, lower=factor * joint.lower, upper=factor * joint.upper)
            motion = replace(motion, state=factor * motion.state)
        weight = factor**3 if density else 1.0
        low, high = (weight * v for v in own.mass.interval)
        mass = replace(own.mass, value=weight * own.mass.value, interval=(low, high))
        inertial = Inertial(mass, factor * own.com, weight * factor**2 * own.inertia)
        return replace(
            p, mesh=replace(p.mesh, vertices=factor * p.mesh.vertices), joint=joint, motion=motion, contact=None,
            inertial=inertial, physics=None, collision=tuple(map(shape, p.collision)),
        )  # fmt: skip

    mesh = replace(twin.static.mesh, vertices=factor * twin.static.mesh.vertices)
    static = replace(twin.static, mesh=mesh, collision=tuple(map(shape, twin.static.collision)))
    odd = replace(
        twin, static=static, parts=tuple(map(part, twin.parts)), cameras=None, recorded=None, labels={}
    )
    return complete(odd)


def extreme(seed: int) -> Twin:
    """Boards of 1 mm to 5 m, 1 g to 2 t, nested and slanted; every fifth a kilometre away."""
    rng = np.random.default_rng([seed, 150])
    twin = random_twin(seed)
    if seed % 2:
        twin = scaled(twin, float(np.exp(rng.uniform(np.log(0.05), np.log(10.0)))))
    return moved(twin, 1000.0 * rng.normal(size=3)) if seed % 5 == 0 else twin


def is_so(row: BehaviourRow) -> bool:
    """Whether the row names what keeps a part from moving, and its own numbers bear it out."""
    if row.quantity == "demonstration_m":
        return "all that a hand gives, with" in row.explanation
    said = re.search(
        r"by ([\d.e+-]+) \S.*friction of ([\d.e+-]+) .*, ([\d.e+-]+) (?:kg|kg m²) to move", row.explanation
    )
    if row.quantity not in ("open", "close") or said is None:
        return False
    pull, friction, inertia = map(float, said.groups())
    # of 10 s; two digits of what is told and a range of at least 5 cm or 0.05 rad
    return pull < 1.05 * friction or 0.5 * (pull - friction) / inertia * 10.0**2 < 1.6


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, SEEDS, 10))
def test_what_the_check_says_no_to_is_so(first: int, tmp_path: Path) -> None:
    for seed in range(first, first + 10):
        twin = extreme(seed)
        formats = ["urdf", "mjcf", "usd"] if seed % 5 == 0 else ["mjcf"]
        files = export(twin, tmp_path / str(seed), formats)
        report, moves = check(twin, files), behave(twin, files)
        assert (seed, report.warnings, report.failures) == (seed, (), ())
        assert (seed, moves.warnings) == (seed, ())
        assert [(seed, row) for row in moves.failures if not is_so(row)] == []


@pytest.mark.parametrize("factor", [0.027, 0.01])
def test_a_cabinet_of_millimetres_loads_and_moves_in_every_format(factor: float, tmp_path: Path) -> None:
    """A cube of 1 m shrunk to a handle of 0.3 mm has a determinant of 3e-11, which OpenUSD takes for
    singular."""
    twin = scaled(cabinet_twin(), factor, density=True)
    files = export(twin, tmp_path)
    report, moves = check(twin, files), behave(twin, files)
    assert (report.warnings, report.failures) == ((), ())
    assert (moves.warnings, moves.failures) == ((), ())


def test_a_light_part_that_carries_a_heavy_one_stays_where_it_is_left(tmp_path: Path) -> None:
    """Put back after every step, a falling 300-kg part threw the one beneath it by 77 mm where nothing
    pulled."""
    twin = random_twin(1)
    moves = behave(twin, export(twin, tmp_path, ["mjcf"]))
    wrong = {"rest_m", "rest_half_open_m", "slides_m", "energy"}
    assert [r for r in moves.failures if r.quantity in wrong or not is_so(r)] == []
