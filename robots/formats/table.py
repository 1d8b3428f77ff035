"""The formats by name, and writing several of them so that a folder never holds a part of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robots.formats import delimited, lerobot, moveit, native, ros2, spot
from robots.formats.trajectory_export import PlannedMotion, require_trust
from twin.errors import InputError, nearest_name
from twin.files.atomic import staging
from twin.files.own_files import place_own
from twin.files.paths import AnyPath
from twin.files.text import write_json
from twin.names import several
from twin.verdict import verdict_document

VERDICT = "verdict.json"  # beside the formats, most of which have no room for it


@dataclass(frozen=True)
class Format:
    """One format: what it is, the files it may write (paths in the output folder), and the function for them.

    `render` returns the contents of those that this trajectory needs.
    """

    what: str
    files: tuple[str, ...]
    render: Callable[[PlannedMotion], Mapping[str, bytes]]


FORMATS: dict[str, Format] = {
    "json": Format("everything, readable", ("trajectory.json",), native.render_json),
    "npz": Format("the arrays, for NumPy", ("trajectory.npz",), native.render_npz),
    "csv": Format("a table, one line a sample", delimited.FILES, delimited.render),
    "ros2": Format(
        "trajectory_msgs/JointTrajectory of arm and gripper, and where the base moves",
        ros2.FILES,
        ros2.render,
    ),
    "moveit": Format("moveit_msgs/CartesianTrajectory of the tool", moveit.FILES, moveit.render),
    "spot": Format(
        "bosdyn.api.ArmImpedanceCommand.Request, one a leg, and where the body moves", spot.FILES, spot.render
    ),
    "lerobot": Format("LeRobot v3.0 dataset of one episode", lerobot.FILES, lerobot.render),
}


def export_trajectory(
    source: PlannedMotion,
    formats: str | Sequence[str],
    folder: AnyPath,
    overwrite: bool = False,
    *,
    accept_doubtful: bool = False,
) -> dict[str, list[Path]]:
    """Write a trajectory in the named formats; returns the files of each, in the order asked for.

    Everything is made before anything is written, then moved into place. Files of an earlier call are
    replaced; files.json in the folder tells which those are. The verdict on a reconstructed part stands in
    verdict.json beside them, and within those that have room for it.

    Args:
        overwrite: also replace files that were changed since, and others of the same names.
        accept_doubtful: also of a part whose verdict is worse than trusted.

    Raises:
        InputError: an unknown format, or a folder that can't be written, holds something else where a format
            has its own folder, or a file that would be replaced and is not, or no longer, what an earlier
            call wrote; or a part that is not trusted.
        MissingDependencyError: a format needs an optional package; the message names the extra.
    """
    chosen = [_known(name) for name in dict.fromkeys(several(formats))]
    require_trust(source.part, accept_doubtful)
    rendered = {name: dict(FORMATS[name].render(source)) for name in chosen}
    folder = Path(folder)
    for name in chosen:
        _refuse_strangers(folder, name)
    try:
        with staging(folder / "trajectory") as staged:
            for path, data in (item for files in rendered.values() for item in files.items()):
                (staged / path).parent.mkdir(parents=True, exist_ok=True)
                (staged / path).write_bytes(data)
            if source.part.verdict is not None:
                write_json(staged / VERDICT, verdict_document(source.part.verdict))
            scope = [VERDICT, *(path for name in chosen for path in FORMATS[name].files)]
            place_own(staged, folder, scope, overwrite)
    except OSError as e:
        raise InputError(f"{folder} can't be written ({e.strerror})", "choose another output folder") from e
    return {name: [folder / path for path in files] for name, files in rendered.items()}


def _known(name: str) -> str:
    if name not in FORMATS:
        near = nearest_name(name, list(FORMATS))
        hint = f"; did you mean {near!r}?" if near else ""
        raise InputError(f"there is no trajectory format {name!r}", f"formats: {', '.join(FORMATS)}{hint}")
    return name


def _refuse_strangers(folder: Path, name: str) -> None:
    """A format's own folder is read as a whole, so another's file in it would be taken for a part."""
    own = FORMATS[name].files
    for top in {path.split("/")[0] for path in own if "/" in path}:
        found = (p.relative_to(folder).as_posix() for p in (folder / top).rglob("*") if not p.is_dir())
        strange = sorted(set(found) - set(own))
        if strange:
            raise InputError(
                f"{folder / strange[0]} is not of a {name} trajectory", "choose another output folder"
            )
    blocked = [folder / path for path in own if (folder / path).is_dir()]
    if blocked:
        raise InputError(f"{blocked[0]} is a folder", "choose another output folder")
