"""The catch in a log of forces: closed forms, laws of offset and scale, logs of real doors, and logs that are
none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.door_forces import catch, read
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.rested import by_law
from twin.cli import main as cli
from twin.errors import InputError
from twin.geometry import Array
from twin.physics import read_materials
from twin.physics.catches import lever_of, logged_catch
from twin.physics.force_log import ForceLog, along_joint, fit_catch, read_force_log
from twin.scene import Twin
from twin.storage import load, save


def opening(seed: int = 0, noise: float = 0.0, offset: float = 0.0, spikes: int = 0) -> tuple[Array, Array]:
    """States (n,) rad and torques (n,) N m: 1 N m of friction and a catch of 6 N m that falls evenly between
    0.1 and 0.2 rad."""
    rng = np.random.default_rng(seed)
    state = np.linspace(0.0, 1.4, 400)
    force = 1.0 + 6.0 * np.clip((0.2 - state) / 0.1, 0.0, 1.0) + offset + noise * rng.standard_normal(400)
    force[rng.choice(400, spikes, replace=False)] += 30.0
    return state, force


def test_a_catch_is_found_as_it_is() -> None:
    found = fit_catch(*opening())
    assert (found.peak, found.level, found.still) == pytest.approx((7.0, 1.0, 7.0))
    assert found.force == pytest.approx((6.0, 6.0, 6.0))
    assert found.width == pytest.approx((0.15, 0.125, 0.175), abs=0.004)


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_spikes_leave_it_within_its_interval(seed: int) -> None:
    found = fit_catch(*opening(seed, noise=0.3, spikes=8))
    assert found.force[1] <= 6.0 <= found.force[2]
    assert found.force[0] == pytest.approx(6.0, abs=3 * 0.3)
    assert found.width[1] <= 0.15 <= found.width[2]


def test_an_offset_changes_nothing_and_a_factor_everything() -> None:
    state, force = opening(3, noise=0.2)
    plain, shifted, scaled = (fit_catch(state, f) for f in (force, force + 10.0, 2.5 * force))
    assert shifted.force == pytest.approx(plain.force)
    assert shifted.width == plain.width
    assert shifted.level == pytest.approx(plain.level + 10.0)
    assert scaled.force == pytest.approx([2.5 * v for v in plain.force])
    moved = fit_catch(state + 0.7, force)
    assert moved.width == pytest.approx(plain.width), "counted from where the log begins"
    back = fit_catch(np.concatenate([state, state[::-1]]), np.concatenate([force, -force[::-1]]))
    assert back == plain, "what comes after the widest is left out"


@pytest.mark.parametrize(
    "force",
    [
        lambda s: 1.0 + 0.0 * s,
        lambda s: 1.0 + 5.0 * (s > 1.0),
        lambda s: 1.0 + 2.0 * np.random.default_rng(0).standard_normal(len(s)),
    ],
)
def test_without_a_peak_near_closed_there_is_none(force: Callable[[Array], Array]) -> None:
    state = np.linspace(0.0, 1.4, 400)
    with pytest.raises(InputError, match="shows no catch"):
        fit_catch(state, force(state))


def test_real_doors_peak_near_closed(funtwin_data: Path) -> None:
    """What the data's own page says of the IKEA door: 23 to 27 N near 0.1 rad, then 7 to 14 N, and 10 N
    before anything moves."""
    found = {}
    for name in ("ikea_cabinet_2", "ikea_cabinet_log"):
        log = read_force_log(funtwin_data / "door_forces" / f"{name}.npz")
        assert (log.state_unit, log.force_unit) == ("rad", "N")
        fit = found[name] = fit_catch(log.state, log.force)
        assert 23.0 < fit.peak < 27.0
        assert fit.at < 0.2
        assert 7.0 < fit.level < 14.0
        assert 10.0 < fit.still < 14.0
        assert fit.force[0] == pytest.approx(fit.peak - fit.level)
        assert 10.0 < fit.force[1] < fit.force[0] < fit.force[2] < 22.0
        assert fit.width[2] - fit.width[1] > 0.2, (
            "the log has no sample between 0.2 and 0.5 rad, and its width says so"
        )
    one, two = found.values()
    assert one.force[1] < two.force[0], "two runs of one door agree within their intervals"
    assert two.force[1] < one.force[2]


def test_the_typical_catch_is_what_the_logs_of_real_doors_show(funtwin_data: Path) -> None:
    logs = [read(p) for p in sorted((funtwin_data / "door_forces").glob("*.npz"))]
    told = read_materials().catches["revolute"]
    for want, got in zip(catch(logs), (told.force, told.width), strict=True):
        assert (got.value, *got.interval) == pytest.approx(want, abs=0.05)
        assert got.origin == "typical"
    assert set(read_materials().catches) == {"revolute"}, "there is no log of a drawer"


def test_units_are_those_of_the_joint(tmp_path: Path) -> None:
    state, force = opening()
    rows = np.column_stack([np.rad2deg(state), force / 0.4])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="angle_deg, force_N", comments="")
    np.savez(tmp_path / "b.npz", opening_mm=1e3 * 0.4 * state, torque_Nm=force, note=np.zeros(3))
    np.savetxt(
        tmp_path / "c.csv",
        np.column_stack([state, force]),
        delimiter=",",
        header="angle_rad,torque_Nm",
        comments="",
    )
    for name, lever in (("a.csv", 0.4), ("b.npz", 0.4), ("c.csv", None)):
        got = along_joint(read_force_log(tmp_path / name), "revolute", lever)
        assert got[0] == pytest.approx(state)
        assert got[1] == pytest.approx(force)
    slide = ForceLog("d", state, force, "m", "N")
    assert along_joint(slide, "prismatic", None) == (slide.state, slide.force)
    with pytest.raises(InputError, match="log of a hinge"):
        along_joint(read_force_log(tmp_path / "a.csv"), "prismatic", None)
    with pytest.raises(InputError, match="with --lever"):
        along_joint(read_force_log(tmp_path / "a.csv"), "revolute", None)


@pytest.fixture(scope="module")
def filled() -> Twin:
    return by_law(cabinet_twin())


def test_the_command_puts_a_log_s_catch_into_the_twin(
    filled: Twin, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(filled, tmp_path / "run" / "twin")
    state, force = opening()
    door = filled.part("door")
    lever = lever_of(door)
    assert lever is not None
    np.savez(tmp_path / "pull.npz", angle_rad=state, force_N=force / lever)
    log = ["--log", str(tmp_path / "pull.npz")]
    assert (
        cli.run(["physics", "catch", str(tmp_path / "run"), "--part", "door", *log, "--note", "gauge"]) == 0
    )
    physics = load(tmp_path / "run").part("door").physics
    assert physics is not None
    assert physics.catch == logged_catch(door, tmp_path / "pull.npz", note="gauge")
    assert physics.catch.force.value == pytest.approx(6.0)
    assert physics.catch.force.source.startswith("measured: pull.npz: peak of 7 N m at ")
    assert physics.catch.force.source.endswith("gauge")
    assert "6 N m (6 to 6)" in capsys.readouterr().out
    assert logged_catch(door, tmp_path / "pull.npz", lever=2 * lever).force.value == pytest.approx(12.0)


GOOD = "angle_rad,force_N\n" + "".join(f"{k / 20},{9 if k < 4 else 1}\n" for k in range(40))
BAD: dict[str, tuple[bytes, str]] = {
    "none.csv": (b"", "has no columns"),
    "words.csv": (GOOD.encode().replace(b"force_N", b"push"), "has angle_rad"),
    "two.csv": (
        GOOD.encode().replace(b"angle_rad,force_N", b"angle_rad,angle_deg"),
        "has angle_rad, angle_deg",
    ),
    "text.csv": (GOOD.encode().replace(b"0.5,1", b"0.5,much"), "row 11 has 'much' for force_N"),
    "ragged.csv": (GOOD.encode().replace(b"0.5,1", b"0.5"), "row 11 has 'nothing' for force_N"),
    "nan.csv": (GOOD.encode().replace(b"0.5,1", b"0.5,nan"), "not finite"),
    "short.csv": (b"angle_rad,force_N\n0,9\n1,1\n", "has 2 samples"),
    "flat.csv": (GOOD.encode().replace(b",9", b",1"), "shows no catch"),
    "still.csv": (b"angle_rad,force_N\n" + 30 * b"0,1\n", "0 samples beyond half of its way"),
    "latin.csv": (b"\xff\xfe\x00", "can't be read as csv"),
    "no.npz": (b"PK\x03\x04 nothing", "can't be read as npz"),
    "empty.npz": (b"", "can't be read as npz"),
}


@pytest.mark.parametrize(
    "name", [*BAD, "missing.csv", "missing.npz", "pickle.npz", "uneven.npz", "square.npz", "."]
)
def test_a_log_that_is_none_is_one_line_and_exit_1(
    filled: Twin, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    save(filled, tmp_path / "run" / "twin")
    before = (tmp_path / "run" / "twin" / "twin.json").read_bytes()
    path, said = (
        tmp_path / name,
        {"pickle.npz": "can't be read", "uneven.npz": "shape (3,)", "square.npz": "shape (9, 9)"},
    )
    if name in BAD:
        path.write_bytes(BAD[name][0])
    elif name == "pickle.npz":
        np.savez(path, angle_rad=np.array([{}, []], dtype=object), force_N=np.zeros(2))
    elif name == "uneven.npz":
        np.savez(path, angle_rad=np.zeros(3), force_N=np.zeros(2))
    elif name == "square.npz":
        np.savez(path, angle_rad=np.zeros((9, 9)), force_N=np.zeros((9, 9)))
    want = BAD[name][1] if name in BAD else said.get(name, "can't be read")
    assert cli.run(["physics", "catch", str(tmp_path / "run"), "--part", "door", "--log", str(path)]) == 1
    told = capsys.readouterr().err
    assert want in told
    assert told.count("\n") == 1
    assert (tmp_path / "run" / "twin" / "twin.json").read_bytes() == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "required"),
        (["--typical", "--none"], "not allowed with"),
        (["--typical", "--width", "3deg"], "--width says nothing here"),
        (["--hold", "7Nm", "--lever", "0.4"], "--lever says nothing here"),
        (["--log", "x.csv", "--measured"], "--measured says nothing here"),
        (["--log", "x.csv", "--lever", "-1"], "--lever must be more than 10 mm"),
        (["--hold", "7Nm", "--hold-interval", "8Nm", "9Nm"], "must lie inside its interval"),
    ],
)
def test_options_that_say_nothing_are_refused(
    filled: Twin, tmp_path: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    save(filled, tmp_path / "run" / "twin")
    assert cli.run(["physics", "catch", str(tmp_path / "run"), "--part", "door", *options]) == 1
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
