"""The joints of an MJCF scene, by MuJoCo alone: a wrong name is reported before drawing is imported."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import InputError, nearest_name

if TYPE_CHECKING:
    import mujoco

JOINT_TYPES = {3: "revolute", 2: "prismatic"}  # mujoco.mjtJoint: mjJNT_HINGE, mjJNT_SLIDE


def require_joint(scene: Path | str, joint: str) -> None:
    """Raises InputError unless the scene (an MJCF file or "kitchen") loads and has this hinge or slide."""
    find_joint(load_model(scene_path(scene)), joint)


def scene_path(scene: Path | str) -> Path:
    """The MJCF file that `scene` names: a path, or "kitchen"."""
    if str(scene) == "kitchen":
        from recon.simulate.kitchen import kitchen_scene

        return kitchen_scene()
    return Path(scene)


def load_model(scene: Path | str) -> mujoco.MjModel:
    """Load an MJCF file. Raises InputError with MuJoCo's reason in one line."""
    if not Path(scene).is_file():
        raise InputError(f"no scene file {scene}", "give the path of an MJCF file (*.xml)")
    import mujoco

    try:
        return mujoco.MjModel.from_xml_path(str(scene))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"MuJoCo can't load the scene {scene}: {reason}", "check it with MuJoCo's viewer"
        ) from error


def joint_names(model: mujoco.MjModel) -> list[str]:
    """Names of the hinge and slide joints of a model."""
    return [model.joint(j).name for j in range(model.njnt) if int(model.jnt_type[j]) in JOINT_TYPES]


def find_joint(model: mujoco.MjModel, name: str) -> int:
    """Index of the hinge or slide joint `name`. Raises InputError that lists the joints there are."""
    import mujoco

    names = joint_names(model)
    if name not in names:
        near = nearest_name(name, names)
        hint = f"did you mean {near!r}? " if near else ""
        there = ", ".join(n for n in names if n) or "none"
        raise InputError(
            f"the scene has no hinge or slide joint {name!r}", f"{hint}joints that exist: {there}"
        )
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name))
