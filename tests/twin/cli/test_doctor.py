"""The doctor finds what is missing and names one command for it."""

from __future__ import annotations

import os
import re
import shutil
import sys

import pytest

from twin import packages
from twin.cli import doctor
from twin.cli.doctor import Finding
from twin.packages import to_install


def test_this_machine_is_fit_for_the_tests() -> None:
    """The suite itself runs here, so nothing that is needed can be missing, and a picture can be drawn."""
    missing = [f for f in doctor.diagnose() if f.needed and not f.ok]
    assert missing == []
    assert doctor.remedies(doctor.diagnose()) == []


@pytest.mark.parametrize(
    ("version", "ok"), [((3, 10), False), ((3, 11), True), ((3, 12), True), ((3, 13), False)]
)
def test_python_version(version: tuple[int, int], ok: bool) -> None:
    finding = doctor.check_python(version)
    assert finding.ok is ok
    assert f"{version[0]}.{version[1]}" in finding.detail


def test_all_missing_libraries_take_one_command() -> None:
    def load(name: str) -> object:
        if name in ("libGL.so.1", "libEGL.so.1"):
            raise OSError(name)
        return object()

    findings = doctor.check_libraries(load)
    assert [f.name for f in findings if not f.ok] == ["libgl1", "libegl1"]
    (command,) = doctor.remedies(findings)
    assert command.endswith("apt-get install -y libgl1 libegl1")


def test_missing_and_old_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    required = ["no-such-package-here>=1", "numpy>=99.0", "rich>=1", 'mediapipe==0.1; extra == "hands"']
    monkeypatch.setattr(packages.metadata, "requires", lambda _: required)
    findings = doctor.check_packages()
    assert [(f.name, f.ok) for f in findings] == [
        ("no-such-package-here", False),
        ("numpy", False),
        ("rich", True),
    ]
    assert findings[0].detail == "not installed"
    assert ">=99.0 wanted" in findings[1].detail
    (remedy,) = doctor.remedies(findings)
    assert remedy == (
        f"install the Python packages no-such-package-here>=1, numpy>=99.0 into the Python environment {sys.prefix}"
    )


def test_missing_extra_is_no_illness(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages.metadata, "requires", lambda _: ['nothing-like-it>=2; extra == "hands"'])
    hands = next(f for f in doctor.check_extras() if f.name == "extra hands")
    assert not hands.ok
    assert not hands.needed
    assert "nothing-like-it>=2" in hands.remedy
    assert doctor.remedies([hands]) == []


def test_broken_rendering_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no-such-driver")
    finding = doctor.check_rendering()
    assert not finding.ok
    assert finding.detail.startswith("RuntimeError: ")
    assert "no-such-driver" in finding.detail
    assert "libgl1-mesa-dri" in finding.remedy


def test_drawing_is_not_tried_on_an_unfit_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    bad = Finding("libgl1", False, "not found", "x")
    monkeypatch.setattr(doctor, "check_libraries", lambda: [bad])
    monkeypatch.setattr(doctor, "check_rendering", lambda: pytest.fail("tried"))
    assert not next(f for f in doctor.diagnose() if f.name == "rendering").ok


def test_versions_compare_as_numbers() -> None:
    assert doctor._fits("2.10.1", ">=", "2.9")
    assert not doctor._fits("1.9", ">=", "2")
    assert doctor._fits("25.11", "==", "25.11")
    assert not doctor._fits("25.12", "==", "25.11")


@pytest.mark.parametrize(("euid", "start"), [(0, "apt-get"), (1000, "sudo apt-get")])
def test_the_command_fits_the_user(euid: int, start: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: euid)
    assert doctor._apt(["libgl1"]).startswith(start)


def test_without_apt_the_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert doctor._apt(["libgl1", "libegl1"]) == "install what Debian's packages libgl1 libegl1 hold"


def test_no_remedy_assumes_an_installer_or_a_makefile(monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment of uv or pipx has no pip, and outside of a checkout there is nothing to make."""
    monkeypatch.setattr(packages.metadata, "version", lambda _: "0.0.1")
    found = [*doctor.check_packages(), *doctor.check_extras(), doctor.check_python((3, 10))]
    assert not any(f.ok for f in found)
    told = [*doctor.remedies(found), *(f.remedy for f in found), to_install("mediapipe", "hands")]
    assert [t for t in told if not t or re.search(r"\bpip\b|\bmake\b|funtwin\[", t)] == []


def test_a_library_is_named_with_the_version_that_is_wanted() -> None:
    told = to_install("mediapipe", "hands")
    assert re.match(r"install the package mediapipe==0\.10\.14 \(Funtwin's extra `hands`\) into", told)
    assert to_install("anything") == f"install the package anything into {packages.environment()}"


def test_funtwin_itself_may_not_be_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise packages.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(packages.metadata, "requires", absent)
    (finding,) = doctor.check_packages()
    assert not finding.ok
    assert "install the package funtwin into" in finding.remedy
    assert to_install("mediapipe", "hands").startswith("install the package mediapipe (")
