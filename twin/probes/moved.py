"""One part of an exported file that moves alone in MuJoCo, the others held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from math import isfinite
from typing import Any

import mujoco
import numpy as np

_BROKEN = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


class BrokenDown(Exception):
    """The simulation diverged."""


@dataclass(frozen=True)
class Moved:
    """A model in which one part moves: its body, degree of freedom, place in qpos, and range."""

    model: Any
    body: int
    dof: int
    at: int
    lower: float
    upper: float

    def data(self, state: float) -> Any:
        """A fresh simulation with the part at `state`."""
        data = mujoco.MjData(self.model)
        data.qpos[self.at] = state
        mujoco.mj_forward(self.model, data)
        return data


def moved(spec: Any, whole: Any, part: str, held: Mapping[str, float]) -> Moved:
    """The file with one joint, `part`'s; others' bodies fixed where `held` ({part: state}, else 0) has them.

    They can't be held by putting them back after every step: within one, a heavy part that falls freely
    throws about the light one that it hangs on. Nor by inertia or constraints: both leave the solver numbers
    that differ by a factor of 10^9.
    """
    alone, data, own = spec.copy(), mujoco.MjData(whole), _joint(whole, part)
    for name, state in held.items():
        data.qpos[whole.jnt_qposadr[_joint(whole, name)]] = state
    mujoco.mj_kinematics(whole, data)
    for joint in list(alone.joints):
        if joint.name != whole.joint(own).name:
            _place(joint.parent, whole, data)
            for sensor in [s for s in alone.sensors if s.objname == joint.name]:
                alone.delete(sensor)
            alone.delete(joint)
    _keep_apart(alone, whole, int(whole.jnt_bodyid[own]))
    alone.compiler.fusestatic = False
    model = alone.compile()
    lower, upper = map(float, model.jnt_range[0])
    return Moved(
        model, int(model.jnt_bodyid[0]), int(model.jnt_dofadr[0]), int(model.jnt_qposadr[0]), lower, upper
    )


def _joint(model: Any, part: str) -> int:
    """Index of the joint of a part, which readers may put into a namespace."""
    return {model.joint(j).name.split("/")[-1]: j for j in range(model.njnt)}[f"{part}_joint"]


def _place(body: Any, model: Any, data: Any) -> None:
    """Give a body of a specification the pose in its parent that it has in `data`."""
    at = model.body(body.name).id
    pose = np.linalg.inv(pose_of(data, int(model.body_parentid[at]))) @ pose_of(data, at)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, pose[:3, :3].flatten())
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.pos, body.quat = pose[:3, 3], quat


def _keep_apart(spec: Any, model: Any, body: int) -> None:
    """What a joint links does not touch; without its own joint the parent would count as the world."""
    parent = int(model.body_weldid[model.body_parentid[body]])
    if parent == 0 or spec.option.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT):
        return
    for a, b in product(*(np.flatnonzero(model.body_weldid == k) for k in (parent, body))):
        spec.add_exclude(bodyname1=model.body(a).name, bodyname2=model.body(b).name)


def watch(data: Any) -> Callable[[], None]:
    """What to call after every step: it raises BrokenDown when the simulation has diverged. It keeps what it
    looks at, as each access takes as long as a step."""
    speed, bad = data.qvel, [data.warning[w] for w in _BROKEN]

    def insist() -> None:
        if bad[0].number or bad[1].number or bad[2].number or not all(map(isfinite, speed.tolist())):
            raise BrokenDown

    return insist


def pose_of(data: Any, body: int) -> Any:
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return t
