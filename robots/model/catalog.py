"""Finds a robot by name or path."""

from __future__ import annotations

import logging
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from robots.model.spec import RobotSpec, load_spec
from twin.errors import InputError, MissingDependencyError, nearest_name
from twin.files.assets import REMEDY, asset
from twin.files.paths import AnyPath
from twin.packages import to_install

_LOG = logging.getLogger(__name__)
# the real models' modules in the package robot_descriptions; importing one clones MuJoCo Menagerie
_FETCHED = {"franka": "panda_mj_description", "spot": "spot_mj_description"}


def names() -> list[str]:
    """Names of the robots that ship with the project. Raises InputError when none is there."""
    folder = asset("robots")
    found = sorted(p.stem for p in folder.glob("*.toml"))
    if not found:
        raise InputError(f"no robot file is in {folder}", REMEDY)
    return found


def resolve(robot: AnyPath) -> RobotSpec:
    """The robot of this name or file. What was taken is logged.

    Args:
        robot: a bundled name (`names()`), a `.toml` robot file, or an MJCF or URDF file with its `.toml`
            beside it.

    Raises:
        InputError: nothing of that name; the message lists what exists.
    """
    path = Path(robot)
    if path.suffix.lower() in {".xml", ".urdf", ".toml"} or path.is_file():
        toml = path.with_suffix(".toml")
        if path.suffix.lower() != ".toml" and path.is_file() and not toml.is_file():
            raise InputError(
                f"robot model {path} has no {toml.name} beside it that names its arm, tool and gripper",
                f"write one like {asset('robots/franka.toml')}",
            )
        spec = load_spec(toml)
        _LOG.info("robot %s from %s, model %s", spec.name, toml, spec.model)
        return spec
    if path.is_dir() and str(robot) not in names():
        inside = ", ".join(sorted(p.name for p in path.glob("*.toml"))) or "none"
        raise InputError(
            f"robot {str(robot)!r} is a folder",
            f"give a .toml robot file (in it: {inside}) or a known robot: {', '.join(names())}",
        )
    known = _known(str(robot), names())
    _LOG.info("robot %s is the bundled model", known)
    return load_spec(asset(f"robots/{known}.toml"))


def fetch(robot: str) -> Path:
    """Download the real model of a bundled robot, the only use of a network; returns its file.

    It is done by the package robot_descriptions, which clones MuJoCo Menagerie into its cache; a robot file
    may then name the model by its path in Menagerie.

    Raises:
        InputError: no such robot, or the download failed.
        MissingDependencyError: robot_descriptions is not installed.
    """
    module = _FETCHED[_known(robot, sorted(_FETCHED))]
    if find_spec("robot_descriptions") is None:
        raise MissingDependencyError(
            "fetching a robot model needs the package robot_descriptions, which is not installed",
            f"{to_install('robot_descriptions')} (it needs git), or check out MuJoCo Menagerie and set FUNTWIN_MENAGERIE; "
            "the bundled models need neither",
        )
    try:
        return Path(str(import_module(f"robot_descriptions.{module}").MJCF_PATH))
    except Exception as e:  # git, the network or the package's own faults: its errors have no common base
        raise InputError(
            f"the model of {robot!r} can't be fetched: {' '.join(str(e).split()) or type(e).__name__}",
            "see that git and the network work, or set FUNTWIN_MENAGERIE to a checkout",
        ) from e


def _known(robot: str, known: list[str]) -> str:
    if robot in known:
        return robot
    near = nearest_name(robot, known)
    raise InputError(
        f"there is no robot {robot!r}",
        f"known robots: {', '.join(known)}{f'; did you mean {near!r}?' if near else ''}"
        " (or give the path of a .toml robot file)",
    )
