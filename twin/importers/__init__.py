"""Articulated scenes from elsewhere become twins: URDF and MJCF files, whoever wrote them.

    cabinet = twin.from_urdf("cabinet.urdf")
    kitchen = twin.from_mjcf("kitchen.xml", exclude=["robot*"], closed={"microwave_joint": "upper"})

A reader for each format fills one neutral description (twin.importers.source), from which the twin is built
(twin.importers.build). docs/importing.md tells what is taken, what is left out and what stands in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from twin.errors import InputError
from twin.files.paths import AnyPath
from twin.importers.source import Closed
from twin.lint.xml import read_xml
from twin.names import several
from twin.scene import Twin

__all__ = ["from_file", "from_mjcf", "from_urdf"]


def from_urdf(
    path: AnyPath,
    *,
    closed: Mapping[str, Closed] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    exclude: str | Sequence[str] = (),
) -> Twin:
    """The twin that a URDF file describes.

    Links that don't move are the static scene; a link on a revolute or prismatic joint is a part, with what
    is fixed to it. Numbers that the file doesn't state (mass, joint resistance, contact friction) come from
    the table of materials, as in any twin. Nobody moved the parts: their motions are empty. What a twin can't
    carry, and what `twin lint` calls an error in the file's text, is told as a UserWarning.

    Args:
        closed: joint -> its closed position, state 0 of the twin: "lower", "upper", or a number in the file's
            own m or rad. Left out: the end of the range near the file's rest pose (zero), else the rest pose;
            docs/importing.md tells all.
        limits: joint -> (lower, upper) in the file's own m or rad; for joints that have none, or others.
        exclude: names of links, * and ? allowed, that are left out with all that hangs on them.

    Raises:
        InputError: the file, or a mesh that it names, can't be read, or it moves in a way that a twin can't:
            names the element.
    """
    return _from("urdf", path, closed, limits, exclude)


def from_mjcf(
    path: AnyPath,
    *,
    closed: Mapping[str, Closed] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    exclude: str | Sequence[str] = (),
    visual_groups: Sequence[int] = (),
) -> Twin:
    """The twin that an MJCF file describes: as `from_urdf`, with bodies for links and qpos0 as rest pose.

    Args:
        visual_groups: groups of geoms that are seen, 0 to 5; left out, the model's own groups say which are.
    """
    return _from("mjcf", path, closed, limits, exclude, visual_groups)


def from_file(
    path: AnyPath,
    *,
    closed: Mapping[str, Closed] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    exclude: str | Sequence[str] = (),
    visual_groups: Sequence[int] = (),
) -> Twin:
    """`from_urdf` or `from_mjcf`, whichever the file's root element asks for."""
    return _from("", path, closed, limits, exclude, visual_groups)


def _from(
    wanted: str,
    path: AnyPath,
    closed: Mapping[str, Closed] | None,
    limits: Mapping[str, tuple[float, float]] | None,
    exclude: str | Sequence[str],
    visual_groups: Sequence[int] = (),
) -> Twin:
    file = Path(path)
    fmt = format_of(file)
    if wanted and fmt != wanted:
        raise InputError(f"{file} is {fmt.upper()}, not {wanted.upper()}", f"read it with twin.from_{fmt}")
    if fmt == "urdf" and visual_groups:
        raise InputError(f"{file} is URDF, which has no geom groups", "leave visual groups out")
    from twin.importers.build import build
    from twin.importers.linted import errors

    if fmt == "urdf":
        from twin.importers import urdf

        source = urdf.read(file)
    else:
        from twin.importers import mjcf

        source = mjcf.read(file, visual_groups)
    source = replace(source, notes=(*errors(file), *source.notes))
    return build(source, closed or {}, limits or {}, several(exclude))


def format_of(path: Path) -> str:
    """ "urdf" or "mjcf", by the root element. Raises InputError for any other file."""
    if not path.is_file():
        raise InputError(f"{path} is no file", "give a URDF or MJCF file")
    if path.suffix.lower() == ".xacro":
        raise InputError(f"{path} is a xacro template", "expand it first: xacro model.xacro > model.urdf")
    if path.suffix.lower() in (".usd", ".usda", ".usdc", ".usdz"):
        raise InputError(f"{path} is USD, which is not read yet", "give the scene as URDF or MJCF")
    root = read_xml(path)[0]
    tag = root.tag
    if any(e.tag.startswith("xacro:") for e in root.iter()):
        raise InputError(f"{path} is a xacro template", "expand it first: xacro model.xacro > model.urdf")
    if tag == "mujocoinclude":
        raise InputError(
            f"{path} is a piece of an MJCF model (mujocoinclude)",
            "give the file that includes it, or write one: <mujoco><include file='ASSETS.xml'/><worldbody>"
            f"<include file='{path.name}'/></worldbody></mujoco>",
        )
    if tag == "sdf":
        raise InputError(f"{path} is SDF, which is not read", "convert it to URDF or MJCF")
    if tag not in ("robot", "mujoco"):
        raise InputError(f"{path} is neither URDF nor MJCF: its root is <{tag}>", "give a URDF or MJCF file")
    return "urdf" if tag == "robot" else "mjcf"
