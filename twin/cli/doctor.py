"""What this machine and this installation lack to run Funtwin, and what brings it."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import metadata

from twin.errors import InputError
from twin.files.assets import REMEDY, asset, faults
from twin.packages import environment, normal, requirements, to_install

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
    "clustering": "motion clustering as in the paper, asked only by `--set motion.method=clusters`",
    "lerobot": "trajectories as LeRobot datasets",
    "record3d": "Record3D's .r3d files and its EXR export",
    "fleet": "many recordings as tasks of a Ray cluster",
    "rerun": "the twin and its recording as a Rerun file",
    "ros": "ROS bags, MCAP files and RealSense recordings",
    "vlm": "masses estimated by a vision-language model, asked only by `twin physics estimate`",
}
HOW_TO_INSTALL = (
    "packages come by what made the environment: `pip install`, `uv pip install`, `pipx inject funtwin`"
)
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
    """One thing looked at. `needed` is False for extras; `remedy` tells what brings what is missing, or it
    follows from `debian` and `python`: the system and Python packages that lack."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    needed: bool = True
    debian: tuple[str, ...] = ()
    python: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        said = [self.remedy, _apt(self.debian), _packages(self.python)]
        object.__setattr__(self, "remedy", next((s for s in said if s), ""))


def diagnose() -> list[Finding]:
    """Look at Python, packages, shipped files, system libraries, rendering and extras; slow imports happen in
    a child process."""
    findings = [check_python(sys.version_info[:2]), *check_packages(), *check_libraries()]
    gl_ready = all(f.ok for f in findings)
    if gl_ready:
        findings.append(check_rendering())
    else:
        findings.append(
            Finding("rendering", False, "not tried before the rest is there", "run `twin doctor` again then")
        )
    return [*findings, *check_assets(), *check_extras()]


def remedies(findings: Iterable[Finding]) -> list[str]:
    """What installs all that is needed and missing: a line for system packages, one for Python packages."""
    missing = [f for f in findings if not f.ok and f.needed]
    debian = _apt(dict.fromkeys(p for f in missing for p in f.debian))
    python = _packages(dict.fromkeys(p for f in missing for p in f.python))
    others = [f.remedy for f in missing if not f.debian and not f.python]
    return [line for line in dict.fromkeys([debian, python, *others]) if line]


def check_python(version: tuple[int, ...]) -> Finding:
    """Is the interpreter one that the pinned packages exist for?"""
    low, high = PYTHON
    text = ".".join(map(str, version))
    names = f"{low[0]}.{low[1]} to {high[0]}.{high[1] - 1}"
    return Finding(
        "python", low <= version < high, f"{text} ({names} wanted)", f"install Funtwin with Python {names}"
    )


def check_packages() -> list[Finding]:
    """The required packages with their versions; absent or too old ones are findings."""
    required = requirements()
    if not required:
        return [Finding("funtwin", False, "not installed", to_install("funtwin"))]
    return [_package(r) for r in required]


def check_assets() -> list[Finding]:
    """The files that ship with Funtwin against their checksums."""
    try:
        wrong = faults()
        place = asset("MANIFEST.toml").parent
    except InputError as e:
        return [Finding("assets", False, e.problem, e.remedy)]
    if not wrong:
        return [Finding("assets", True, f"robots, materials, scenes and recording as shipped, in {place}")]
    return [Finding(f"assets: {name}", False, f"{told}, in {place}", REMEDY) for name, told in wrong.items()]


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
            findings.append(Finding(package, False, f"{library} not found", debian=(package,)))
    return findings


def check_rendering(timeout_s: float = 120.0) -> Finding:
    """Draw a picture with MuJoCo without a screen, in a child process, as a broken driver may end it."""
    env = os.environ | {"MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")}
    drivers = ("libgl1-mesa-dri", "libegl1")
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
        return Finding("rendering", False, f"no picture within {timeout_s:.0f} s", debian=drivers)
    if done.returncode == 0:
        return Finding("rendering", True, f"MuJoCo draws with {env['MUJOCO_GL']}")
    lines = done.stderr.strip().splitlines()
    return Finding("rendering", False, lines[-1] if lines else "an empty picture", debian=drivers)


def check_extras() -> list[Finding]:
    """Optional packages, extra by extra."""
    findings = []
    for extra, use in EXTRAS.items():
        packages = [_package(r) for r in requirements(extra)]
        ok = all(p.ok for p in packages)
        detail = f"{use}: {', '.join(f'{p.name} {p.detail}' for p in packages)}"
        lacking = tuple(r for p in packages for r in p.python)
        findings.append(Finding(f"extra {extra}", ok, detail, needed=False, python=lacking))
    return findings


def _package(requirement: str) -> Finding:
    name = normal(requirement)
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Finding(name, False, "not installed", python=(requirement,))
    wanted = re.search(r"(>=|==)\s*([0-9.]+)", requirement)
    if wanted and not _fits(version, wanted[1], wanted[2]):
        return Finding(name, False, f"{version} ({wanted[0]} wanted)", python=(requirement,))
    return Finding(name, True, version)


def _fits(version: str, sign: str, wanted: str) -> bool:
    have, want = ([int(n) for n in re.findall(r"\d+", v)] for v in (version, wanted))
    return have[: len(want)] == want if sign == "==" else have >= want


def _packages(wanted: Iterable[str]) -> str:
    listed = list(wanted)
    if not listed:
        return ""
    return f"install the Python package{'s'[: len(listed) > 1]} {', '.join(listed)} into {environment()}"


def _apt(packages: Iterable[str]) -> str:
    """The command for Debian and its kin; elsewhere the names, which most systems spell alike."""
    listed = " ".join(packages)
    if not listed:
        return ""
    if shutil.which("apt-get") is None:
        return f"install what Debian's packages {listed} hold"
    return f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install -y {listed}"
