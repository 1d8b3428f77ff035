"""What ships with Funtwin is found from a checkout and from a wheel in any folder, and its absence is told at
once."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from recon import pipeline
from recon.readers import open_recording
from robots.model.catalog import names, resolve
from tests.makers.recon import tiny
from twin.cli import doctor
from twin.cli import main as cli
from twin.errors import InputError
from twin.files import assets as asset_files
from twin.files.assets import asset, faults
from twin.physics import read_materials

ROOT = Path(__file__).parents[1]
ASSETS = ROOT / "assets"


@pytest.fixture
def nothing_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installation that lacks every shipped file."""
    monkeypatch.setattr(asset_files, "places", lambda: (tmp_path / "_assets", tmp_path / "assets"))


@pytest.fixture
def damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installation with one file altered, one missing and no recording; its folder."""
    place = tmp_path / "_assets"
    shutil.copytree(ASSETS, place, ignore=shutil.ignore_patterns("recordings", "chest.xml"))
    with (place / "materials.toml").open("a") as f:
        f.write("\n")
    monkeypatch.setattr(asset_files, "places", lambda: (place, tmp_path / "assets"))
    return place


def test_every_shipped_file_is_listed_and_has_its_checksum() -> None:
    listed = tomllib.loads((ASSETS / "MANIFEST.toml").read_text(encoding="utf-8"))["asset"]
    paths = {a["path"] for a in listed}
    for file in (p.relative_to(ASSETS) for p in ASSETS.rglob("*") if p.is_file()):
        above = {file.as_posix(), *(p.as_posix() for p in file.parents)}
        assert above & paths or file.name == "MANIFEST.toml", f"{file} is not in assets/MANIFEST.toml"
    assert all(a["source"] and a["licence"] == "Apache-2.0" for a in listed)
    assert faults() == {}


def test_altered_and_missing_files_are_findings_of_the_doctor(
    damaged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert faults() == {
        "materials.toml": "altered",
        "scenes/chest.xml": "missing",
        "recordings/cabinet_drawer": "missing",
    }
    found = doctor.check_assets()
    assert not any(f.ok for f in found)
    assert {f.name for f in found} == {f"assets: {name}" for name in faults()}
    assert doctor.remedies(found) == [asset_files.REMEDY]
    assert cli.run(["doctor"]) == 1
    assert "missing or altered" in capsys.readouterr().err
    (damaged / "MANIFEST.toml").write_text("[[asset]]\nname = 3\n")
    (told,) = doctor.check_assets()
    assert "MANIFEST.toml can't be read" in told.detail


@pytest.mark.usefixtures("nothing_shipped")
def test_absent_files_are_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for argv in (["robots", "list"], ["robots", "show", "spot"], ["demo", "-o", "nowhere"]):
        assert cli.run(argv) == 1, argv
        told = capsys.readouterr()
        assert told.out == ""
        assert "ship with Funtwin" in told.err
        assert "install the package funtwin again" in told.err
        assert len(told.err.strip().splitlines()) == 1
    assert not Path("nowhere").exists()
    (finding,) = doctor.check_assets()
    assert not finding.ok
    assert finding.needed
    with pytest.raises(InputError, match="ship with Funtwin"):
        read_materials()


def test_no_robots_is_an_error_and_no_empty_table(damaged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file in (damaged / "robots").iterdir():
        file.unlink()
    assert cli.run(["robots", "list"]) == 1
    assert "no robot file is in" in capsys.readouterr().err
    assert not any(f.ok for f in doctor.check_assets())


@pytest.mark.usefixtures("nothing_shipped")
def test_a_missing_table_of_materials_stops_before_the_first_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pipeline, "quick_findings", lambda *_: pytest.fail("a stage was run"))
    recording = tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    assert cli.run(["reconstruct", str(recording), "-o", str(tmp_path / "run")]) == 1
    assert "ship with Funtwin" in capsys.readouterr().err
    assert not list((tmp_path / "run").glob("stages/[0-9]*"))


@pytest.mark.usefixtures("nothing_shipped")
def test_a_robot_of_ones_own_needs_no_shipped_one(tmp_path: Path) -> None:
    for file in (ASSETS / "robots").glob("franka.*"):
        shutil.copy(file, tmp_path)
    assert resolve(tmp_path / "franka.toml").name == "franka"


def tree(place: Path) -> dict[str, bytes]:
    return {p.relative_to(place).as_posix(): p.read_bytes() for p in place.rglob("*") if p.is_file()}


def build(kind: str, source: Path, out: Path) -> Path:
    """What setuptools makes of the folder: an "sdist" or a "wheel", as any front end calls it."""
    out.mkdir()
    code = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", code, str(out)], cwd=source, capture_output=True, text=True, env=environment()
    )
    assert done.returncode == 0, done.stderr
    (made,) = out.iterdir()
    return made


def environment(**more: str) -> Mapping[str, str]:
    return {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | more


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, made from the sdist of a copy of the checkout, unpacked as an installer does it."""
    place = tmp_path_factory.mktemp("wheel")
    kept = ("pyproject.toml", "setup.py", "README.md", "LICENSE", "THIRD_PARTY.md")
    for folder in ("twin", "recon", "robots", "assets"):
        shutil.copytree(
            ROOT / folder, place / "checkout" / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in kept:
        shutil.copy(ROOT / name, place / "checkout")
    with tarfile.open(build("sdist", place / "checkout", place / "sdist")) as sdist:
        sdist.extractall(place / "unpacked", filter="data")
    (source,) = (place / "unpacked").iterdir()
    wheel = build("wheel", source, place / "dist")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place / "site")  # noqa: S202  (made above)
    return place / "site"


def test_a_wheel_holds_assets_templates_requirements_and_type_markers(installed: Path) -> None:
    assert tree(installed / "twin" / "_assets") == tree(ASSETS)
    for package in ("twin", "recon", "robots"):
        files = [p for p in (ROOT / package).rglob("*") if p.is_file() and "__pycache__" not in p.parts]
        shipped = {p.relative_to(ROOT).as_posix() for p in files}
        assert f"{package}/py.typed" in shipped
        assert [f for f in sorted(shipped) if not (installed / f).is_file()] == []


def test_an_installed_wheel_finds_its_assets_in_any_folder(installed: Path, tmp_path: Path) -> None:
    """In another process and another folder, with nothing of the checkout on the path."""

    def call(*words: str) -> subprocess.CompletedProcess[str]:
        env = environment(PYTHONPATH=str(installed))
        return subprocess.run(
            [sys.executable, *words], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120
        )

    told = call("-c", "import twin.files.assets as a; print(a.asset('robots'), a.faults())")
    assert told.stdout.strip() == f"{installed / 'twin' / '_assets' / 'robots'} {{}}", told.stderr
    listed = call("-m", "twin", "robots", "list", "--json")
    assert listed.returncode == 0, listed.stderr
    assert sorted(json.loads(listed.stdout)["robots"]) == names()
    found = "import recon; from twin.files.assets import asset; print(len(recon.open_recording(asset('recordings/cabinet_drawer'))))"
    assert int(call("-c", found).stdout) == len(open_recording(asset("recordings/cabinet_drawer")))
