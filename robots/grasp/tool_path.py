"""From a hold on the part to 6-DoF tool paths along its articulation."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from robots.grasp.holds import Hold
from robots.model.spec import RobotSpec
from twin import geometry as geo
from twin.geometry import Array
from twin.scene import Joint, Revolute

# m; a hand that lags rolls its fingers about the handle, and this much is a slip
_ROLL = 0.010
# rad by which the hand may lean away from a part's outward direction; chosen by us
_STEEPEST = 0.8
# m that the fingertips keep from the surface behind a handle
_TIP_ROOM = 0.004
# m; how much deeper than the middle of the handle the tool point goes, where it was found on the mesh;
# chosen by us
OVER_INSERT = 0.005
# The same where only the hand's contact is known; chosen by us
_OVER_INSERT_BLIND = 0.020
# m; length of the straight way in and out; chosen by us
APPROACH = 0.10
# Shares of a hinge's angle by which the hand may lag behind the handle; chosen by us
_TURNS = (0.0, 0.25, 0.5, 0.75)
# rad; turns of the hand about the direction in which it closes; chosen by us
_LEANS = (0.0, 0.45, -0.45)
# More of them where a rim is held, which has nothing beside it; chosen by us
_RIM_LEANS = (0.8, -0.8)


@dataclass(frozen=True, eq=False)
class Grasp:
    """A tool pose on a hold and how it follows the part.

    T_world_tool: (4, 4) at state 0, tool axes x along the handle, y closing, z out of the hand. turn: share
    of a revolute angle by which the hand lags behind the part, about the line `handle` (3,) through
    hold.centre. freedom: (3,) orientation weights about the tool axes for inverse kinematics. room: m by
    which the open hand stays aside (-y of the tool) until it closes. cost: 0 = most natural.
    """

    hold: Hold
    T_world_tool: Array
    room: float
    handle: Array
    turn: float
    freedom: Array
    cost: float
    label: str

    def path(self, joint: Joint, states: Array) -> Array:
        """Tool poses (n, 4, 4) in the world for part states (n,)."""
        to_centre = geo.make_pose(translation=-self.hold.centre)
        from_centre = geo.make_pose(translation=self.hold.centre)
        along = float(joint.axis @ self.handle) if isinstance(joint, Revolute) else 0.0
        lag = geo.exp_so3(-self.turn * along * np.asarray(states)[:, None] * self.handle)
        turned = np.tile(np.eye(4), (len(states), 1, 1))
        turned[:, :3, :3] = lag
        return joint.poses(states) @ from_centre @ turned @ to_centre @ self.T_world_tool


def backed_off(T_world_tool: Array, distance: float, aside: float = 0.0) -> Array:
    """The tool pose drawn back along its own z and, by `aside`, to its own -y."""
    return T_world_tool @ geo.make_pose(translation=[0, -aside, -distance])


def make_grasps(
    hold: Hold, joint: Joint, spec: RobotSpec, rank: int = 0, way: float | None = None
) -> list[Grasp]:
    """Both flips of the hand, upright and leant, with and without lag. rank: how many better holds there
    are. way: length of the motion in m or rad, default the joint's whole range.

    Flat fingers that turn about a thick handle roll off its middle by half its thickness times the angle; so
    a lag costs the more, the thicker the handle.

    The tool point goes deeper than the middle of the handle, as far as the stand-off and the palm allow.
    """
    wanted = OVER_INSERT if hold.refined else _OVER_INSERT_BLIND
    deepest = min(wanted, hold.stand_off - spec.tip - _TIP_ROOM)
    closing, along, out = hold.rotation.T
    about, turns = _lags(hold, joint)
    freedom = np.array([0.15 if hold.kind == "bar" else 0.4, 0.4, 0.4])
    way = joint.upper - joint.lower if way is None else way
    leans = (*_LEANS, *_RIM_LEANS) if hold.kind == "edge" else _LEANS
    grasps = []
    for flip, lean, turn in product((1.0, -1.0), leans, turns):
        pivots = turn > 0.0 and abs(about @ closing) > 0.5
        end = lean - turn * abs(way) * float(np.sign(joint.axis @ closing)) if pivots else lean
        if abs(end) > _STEEPEST:
            continue  # the hand would lie down on the part
        upright = np.stack([along * flip, closing * flip, -out], axis=1)
        tool = geo.make_pose(geo.exp_so3(lean * closing) @ upright, hold.centre)
        palm = spec.palm - hold.depth - spec.palm_width / 2 * np.tan(max(abs(lean), abs(end)))
        tool = tool @ geo.make_pose(translation=[0, spec.beside(hold.thickness), min(deepest, palm)])
        roll = 0.0 if pivots else hold.thickness / 2 * turn * abs(way) / _ROLL
        cost = abs(lean) / 0.45 * 0.3 + 1.2 * turn + roll + 0.5 * rank
        cost += (hold.thickness / spec.stroke) ** 2
        label = f"{hold.kind}, flip {flip:+.0f}, lean {np.rad2deg(lean):.0f} deg, lag {turn:.2f}"
        grasps.append(Grasp(hold, tool, spec.room(hold.thickness), about, turn, freedom, cost, label))
    return grasps


def _lags(hold: Hold, joint: Joint) -> tuple[Array, tuple[float, ...]]:
    """The line about which the hand may lag behind a turning handle, and by which shares of the angle.

    Along the handle the fingers roll over it; about the closing direction a knob pivots between them.
    """
    closing, along, _ = hold.rotation.T
    if isinstance(joint, Revolute) and abs(joint.axis @ along) > 0.5:
        return along, _TURNS
    if isinstance(joint, Revolute) and hold.kind == "knob" and abs(joint.axis @ closing) > 0.5:
        return closing, _TURNS
    return along, (0.0,)
