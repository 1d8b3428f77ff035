"""The project's own files agree with each other."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OWN_PINS = {
    re.split(r"==", line)[0]: line
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
}


def normal(requirement: str) -> str:
    """Package name of a requirement, spelled as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=!~ ;]", requirement)[0]).lower()


REQUIREMENTS = [
    *PYPROJECT["dependencies"],
    *(r for e in PYPROJECT["optional-dependencies"].values() for r in e),
]


@pytest.mark.parametrize("requirement", REQUIREMENTS)
def test_direct_dependencies_are_pinned_with_a_reason(requirement: str) -> None:
    assert re.search(r"==\S+  # \S+", OWN_PINS[normal(requirement)])


def test_every_pin_is_exact() -> None:
    bad = [line for line in OWN_PINS.values() if not re.match(r"[a-z0-9-]+==[0-9][^ ]*(  # .*)?$", line)]
    assert bad == []


def test_makefile_and_doctor_name_the_same_libraries() -> None:
    from twin.cli.doctor import LIBRARIES

    make = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    line = re.search(r"^LIBRARIES := (.*)$", make, re.MULTILINE)
    assert line is not None
    assert sorted(entry.split(":")[0] for entry in line[1].split()) == sorted(LIBRARIES)


def test_an_editable_install_is_one_that_type_checkers_follow(tmp_path: Path) -> None:
    """A .pth file that names the checkout; an import hook, which setuptools installs otherwise, is run by no
    type checker."""
    for name in ("setup.py", "pyproject.toml", PYPROJECT["readme"], *PYPROJECT["license-files"]):
        shutil.copy(ROOT / name, tmp_path / name)
    for package in ("twin", "recon", "robots"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
        shutil.copy(ROOT / package / "py.typed", tmp_path / package)
    (tmp_path / "assets" / "robots").mkdir(parents=True)
    (tmp_path / "assets" / "robots" / "arm.toml").touch()
    code = "from setuptools import build_meta; build_meta.build_editable('dist')"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        installed = {n: archive.read(n).decode() for n in archive.namelist() if ".dist-info/" not in n}
    assert [text.strip() for text in installed.values()] == [str(tmp_path)]
    assert [Path(name).suffix for name in installed] == [".pth"]


def tracked_texts() -> list[Path]:
    try:
        names = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    kinds = {".py", ".md", ".toml", ".txt", ".j2", ".xml", ".json", ""}
    return [ROOT / n for n in names.splitlines() if (ROOT / n).suffix in kinds and (ROOT / n).is_file()]


def test_no_file_of_this_machine_is_named() -> None:
    """Paths of one machine and addresses of package servers have no place in the project."""
    pattern = re.compile(r"/(work|home|root|Users)/[A-Za-z]|(pypi|pythonhosted)\.org|--(extra-)?index-url")
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in tracked_texts()
        if path.name not in {"test_project.py", "LICENSE"}
        and (match := pattern.search(path.read_text(encoding="utf-8", errors="replace")))
    ]
    assert found == []


def test_the_page_of_commands_shows_every_verb_and_the_readme_six() -> None:
    from twin.cli.main import VERBS

    shown = {
        page: re.findall(r"^twin ([a-z]+)", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
        for page in ("README.md", "docs/commands.md")
    }
    assert set(VERBS) <= set(shown["docs/commands.md"])
    block = shown["README.md"][-6:]
    assert len(set(block)) == 6
    assert set(block) <= set(VERBS)


def test_python_versions_agree() -> None:
    assert PYPROJECT["requires-python"] == ">=3.11,<3.13"
    make = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "(3, 11) <= sys.version_info[:2] < (3, 13)" in make
