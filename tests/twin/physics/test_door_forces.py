"""The friction of hinges comes from logs of real doors: the method on a closed-form log, and the table
against the logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.door_forces import interval, read, share
from twin.physics import read_materials


def write_log(path: Path, friction: float, arm: float, turn: float, catch: float = 8.0) -> None:
    """A door of radius 0.4 m: a catch up to 0.3 rad, then `friction` N m; the joint torques hold `arm` N
    more."""
    angle = np.concatenate([np.zeros(20), 1.6 * np.linspace(0, 1, 500) ** 1.5])
    there = np.pi / 3 + turn * angle
    out = np.stack([np.cos(there), np.sin(there), 0 * there], axis=1)
    along = turn * np.stack([-np.sin(there), np.cos(there), 0 * there], axis=1)
    pull = np.where(angle < 0.3, catch, friction / 0.4)[:, None]
    np.savez(
        path, ee=[2.0, -1.0, 0.7] + 0.4 * out, cep=[2.0, -1.0, 0.7] + 0.4 * out,
        f_ati=-pull * along - 5.0 * out, f=-(pull + arm) * along - 9.0 * out,
    )  # fmt: skip


@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_a_known_friction_is_found_and_the_arm_s_own_is_told_apart(tmp_path: Path, turn: float) -> None:
    write_log(tmp_path / "door.npz", friction=0.6, arm=7.0, turn=turn)
    log = read(tmp_path / "door.npz")
    assert log.radius == pytest.approx(0.4, abs=1e-6)
    assert log.angle.max() == pytest.approx(1.6, abs=1e-6)
    assert log.peaks == pytest.approx((15.0, 8.0))
    assert log.arm_friction == pytest.approx(7.0)
    assert log.friction == pytest.approx((0.6, 0.6, 0.6))
    assert log.ceiling == pytest.approx(0.6)
    assert abs(log.speed_slope[0]) < 1e-6
    assert interval([log]) == pytest.approx((0.0, 0.6, 0.6))


def test_the_table_s_hinge_friction_is_what_the_logs_of_real_doors_show(funtwin_data: Path) -> None:
    logs = [read(p) for p in sorted((funtwin_data / "door_forces").glob("*.npz"))]
    assert len(logs) == 3
    radius = {log.name: log.radius for log in logs}
    assert radius["ikea_cabinet_2"] == pytest.approx(0.309, abs=0.01), "as the data's own page has it"
    assert radius["ikea_cabinet_log"] == pytest.approx(0.301, abs=0.01)
    low, value, high = interval(logs)
    told = read_materials().joints["revolute"].friction
    least, part, most = share(logs)
    assert told.value == pytest.approx(part, abs=0.005), "rounded"
    assert told.interval[0] <= least
    assert most <= told.interval[1]
    assert "benchmarks/door_forces.md" in told.source
    of_doors = [told.value * log.weight_on_lever for log in logs]
    assert max(of_doors) - value < 0.1, "N m: the law gives the measured doors what was measured"
    assert value - min(of_doors) < 0.1
    shown = (Path(__file__).parents[3] / "benchmarks" / "door_forces.md").read_text(encoding="utf-8")
    assert f"**{value:.2f} N m, {low:.0f} to {high:.1f}**" in shown, "run benchmarks/door_forces.py again"
    assert f"**{part:.3f}, {least:.0f} to {most:.2f}**" in shown, "run benchmarks/door_forces.py again"
