"""Whether what happens on a walk can be seen and reached, and nobody walks through furniture."""

from __future__ import annotations

import numpy as np

from recon.simulate.acts import Act
from recon.simulate.random.witness import CLEAR, LEAST_SHARE, REACH, look
from recon.simulate.record import PART_ID
from recon.simulate.walk.stage import WalkStage
from twin.geometry import invert_pose, transform

# Frames of a motion that are looked at
_MOVING = 5
# s between the frames in which the camera's distance from things is measured
_EVERY = 1.0
# Share of the frames in which the hand holds a part whose grip must be in the picture
_IN_VIEW = 0.7


def unfit_walk(stage: WalkStage) -> str | None:
    """Why nobody could record this; None when it is fit."""
    ids = {p.name: PART_ID + k for k, p in enumerate(stage.room.parts)}
    for act in stage.acts:
        frames = np.linspace(act.line.start, act.line.end, _MOVING).round().astype(int)
        seen = [look(stage, int(k), (ids[act.scene.name],) * 2) for k in frames]
        if np.mean([s.share >= LEAST_SHARE for s in seen]) < 0.5:
            return "what moves is hardly in view"
        if np.mean([s.with_depth >= 0.5 * s.share for s in seen]) < 0.5:
            return "what moves is beyond the depth camera's range"
        if min(s.clear for s in seen) < CLEAR:
            return "the camera meets a surface"
        if grip_in_view(stage, act) < _IN_VIEW:
            return "the grip is out of view"
        held = range(act.line.grasp, act.line.release + 1)
        if max(stage.shoulder_distance(k) for k in held) > REACH:
            return "the arm is too short"
    step = max(1, round(_EVERY * stage.config.fps))
    if min(look(stage, k).clear for k in range(0, len(stage.cameras), step)) < CLEAR:
        return "the camera meets a surface"
    return None


def grip_in_view(stage: WalkStage, act: Act) -> float:
    """Share of the frames in which the hand holds a part whose grip is in the picture."""
    camera, inside = stage.camera, []
    for k in range(act.line.grasp, act.line.release + 1):
        grip = transform(act.scene.pose(float(act.states[k])), act.grasp.point[None])
        pixel = camera.project(transform(invert_pose(stage.cameras[k]), grip))[0]
        inside.append(bool(np.all(pixel >= 0.0) and np.all(pixel <= [camera.width - 1, camera.height - 1])))
    return float(np.mean(inside))
