"""What this machine lacks to run Funtwin, and the one command that brings it."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

# Debian package -> shared library that proves its presence. None: seen only by drawing (`check_rendering`).
LIBRARIES: dict[str, str | None] = {
    "libx11-6": "libX11.so.6",
    "libxcb1": "libxcb.so.1",
    "libgl1": "libGL.so.1",
    "libegl1": "libEGL.so.1",
    "libgl1-mesa-dri": None,
    "libusb-1.0-0": "libusb-1.0.so.0",
    "libglib2.0-0": "libglib-2.0.so.0",
    "libgomp1": "libgomp.so.1",
}
PYTHON = ((3, 11), (3, 13))
# What an extra is for; None of them is needed to reconstruct, export, check and replay.
EXTRAS = {
    "simulate": "recordings of the Franka Kitchen scenes",
    "hands": "contact from hand keypoints instead of label geometry",
    "record3d": "Record3D .r3d files",
    "vlm": "masses estimated by a vision-language model, asked only by `twin physics estimate`",
}
_RENDER = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 3'/><geom size='.1'/></worldbody></mujoco>")
renderer = mujoco.Renderer(model, 32, 32)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer.update_scene(data)
raise SystemExit(0 if renderer.render().max() > 0 else 3)
"""


@dataclass(frozen=True)
class Finding:
    """One thing looked at. `needed` is False for extras; `remedy` is the command that brings what is missing."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    needed: bool = True


def diagnose() -> list[Finding]:
    """Look at Python, packages, system libraries, rendering and extras; slow imports happen in a child process."""
    findings = [check_python(sys.version_info[:2]), *check_packages(), *check_libraries()]
    gl_ready = all(f.ok for f in findings)
    if gl_ready:
        findings.append(check_rendering())
    else:
        findings.append(Finding("rendering", False, "not tried before the rest is there", "twin doctor"))
    return findings + check_extras()


def remedies(findings: Iterable[Finding]) -> list[str]:
    """The commands that bring everything needed which is missing; one for all system packages."""
    commands: list[str] = []
    packages: list[str] = []
    for f in findings:
        if f.ok or not f.needed:
            continue
        if f.remedy.startswith(_apt("")):
            packages += f.remedy[len(_apt("")) :].split()
        elif f.remedy not in commands:
            commands.append(f.remedy)
    return ([_apt(" ".join(packages))] if packages else []) + commands


def check_python(version: tuple[int, ...]) -> Finding:
    """Is the interpreter one that the pinned packages exist for?"""
    low, high = PYTHON
    text = ".".join(map(str, version))
    names = f"{low[0]}.{low[1]} to {high[0]}.{high[1] - 1}"
    return Finding(
        "python", low <= version < high, f"{text} ({names} wanted)", "make install PYTHON=python3.11"
    )


def check_packages() -> list[Finding]:
    """The required packages with their versions; absent or too old ones are findings."""
    try:
        required = metadata.requires("funtwin") or []
    except metadata.PackageNotFoundError:
        return [Finding("funtwin", False, "not installed", "make install")]
    return [_package(r) for r in required if "extra ==" not in r]


def check_libraries(load: Callable[[str], object] = ctypes.CDLL) -> list[Finding]:
    """Can the dynamic loader find the system libraries?"""
    findings = []
    for package, library in LIBRARIES.items():
        if library is None:
            continue
        try:
            load(library)
            findings.append(Finding(package, True, library))
        except OSError:
            findings.append(Finding(package, False, f"{library} not found", _apt(package)))
    return findings


def check_rendering(timeout_s: float = 120.0) -> Finding:
    """Draw one picture with MuJoCo without a screen, in a child process, as a broken driver may end the process."""
    env = os.environ | {"MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")}
    remedy = _apt("libgl1-mesa-dri libegl1")
    try:
        done = subprocess.run(  # noqa: S603  (our own interpreter and script)
            [sys.executable, "-c", _RENDER],
            env=env,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Finding("rendering", False, f"no picture within {timeout_s:.0f} s", remedy)
    if done.returncode == 0:
        return Finding("rendering", True, f"MuJoCo draws with {env['MUJOCO_GL']}")
    lines = done.stderr.strip().splitlines()
    return Finding("rendering", False, lines[-1] if lines else "an empty picture", remedy)


def check_extras() -> list[Finding]:
    """Optional packages, extra by extra."""
    try:
        required = metadata.requires("funtwin") or []
    except metadata.PackageNotFoundError:
        return []
    findings = []
    for extra, use in EXTRAS.items():
        wanted = [r for r in required if f'extra == "{extra}"' in r]
        packages = [_package(r) for r in wanted]
        ok = all(p.ok for p in packages)
        detail = f"{use}: {', '.join(f'{p.name} {p.detail}' for p in packages)}"
        remedy = _pip(" ".join(f"'{r.split(';')[0].strip()}'" for r in wanted))
        findings.append(Finding(f"extra {extra}", ok, detail, remedy, needed=False))
    return findings


def _package(requirement: str) -> Finding:
    match = re.match(r"[A-Za-z0-9_.-]+", requirement)
    assert match is not None
    name = match[0]
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Finding(name, False, "not installed", _install())
    wanted = re.search(r"(>=|==)\s*([0-9.]+)", requirement)
    if wanted and not _fits(version, wanted[1], wanted[2]):
        return Finding(name, False, f"{version} ({wanted[0]} wanted)", _install())
    return Finding(name, True, version)


def _fits(version: str, sign: str, wanted: str) -> bool:
    have, want = ([int(n) for n in re.findall(r"\d+", v)] for v in (version, wanted))
    return have[: len(want)] == want if sign == "==" else have >= want


def _install() -> str:
    return "make install" if Path("Makefile").is_file() else _pip("--upgrade funtwin")


def _pip(what: str) -> str:
    return f"{sys.executable} -m pip install {what}"


def _apt(packages: str) -> str:
    return f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install -y {packages}"
