"""Whether what happens in a drawn recording can be seen and reached at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.simulate.ray_caster import Caster
from recon.simulate.record import OTHER_LABEL, PART_ID
from recon.simulate.shading import primary_rays
from recon.simulate.stage import Stage
from recon.simulate.staged import Staged
from twin.geometry import Array, transform

LEAST_SHARE = 0.01  # of the picture that what moves must cover in half of its moving frames
REACH = 1.0  # metres from the shoulder to the grip, an adult's arm with the upper body bent forward
CLEAR = 0.04  # metres that the camera keeps from everything
NEAREST = 0.25  # metres from which on every sensor measures
FARTHEST = 4.5  # metres to which every sensor measures
_WIDTH = 80  # pixels
_FRAMES = 10  # frames that are looked at


@dataclass(frozen=True)
class Seen:
    """Shares of the picture in one frame: of what moves, and of it with depth in every sensor's reach; and
    the camera's distance from the nearest surface, metres.
    """

    share: float
    with_depth: float
    clear: float


def unfit(stage: Stage) -> str | None:
    """Why nobody could record this; None when it is fit."""
    frames = _moving_frames(stage)
    seen = [look(stage, int(i)) for i in frames]
    if min(s.clear for s in seen) < CLEAR:
        return "the camera meets a surface"
    if stage.script.moves_parts or stage.shows_others:
        if np.mean([s.share >= LEAST_SHARE for s in seen]) < 0.5:
            return "what moves is hardly in view"
        if np.mean([s.with_depth >= 0.5 * s.share for s in seen]) < 0.5:
            return "what moves is beyond the depth camera's range"
    if any(a.reaches for a in stage.acts) and _reach(stage) > REACH:
        return "the arm is too short"
    return None


def _moving_frames(stage: Stage) -> Array:
    """Frames of the whole script that are looked at: while a part or something else moves."""
    lines = [a.line for a in stage.acts]
    every = np.concatenate([np.arange(line.start, line.end + 1) for line in lines])
    return every[np.linspace(0, len(every) - 1, _FRAMES).round().astype(int)]


def look(stage: Staged, k: int, labels_seen: tuple[int, int] = (PART_ID, OTHER_LABEL)) -> Seen:
    """What frame `k` of the whole script shows of labels from the first to the last of `labels_seen`."""
    camera, caster = stage.camera, Caster()
    labels = []
    for actor in stage.actors:
        if actor.present[k]:
            body, pose = actor.body(k), actor.T_world_body[k]
            for s in body.surfaces:
                caster.add(transform(pose, s.vertices), s.faces)
                labels.append(body.label)
    height = max(2, round(_WIDTH * camera.height / camera.width))
    scale = _WIDTH / camera.width
    cx, cy = ((c + 0.5) * scale - 0.5 for c in camera.centre)
    pose = stage.cameras[k].astype(np.float32)
    pixels, centre = np.arange(height * _WIDTH), np.zeros((1, 2), np.float32)
    rays = primary_rays(pixels, _WIDTH, camera.focal * scale, cx, cy, centre, pose)
    hits = caster.first(rays.reshape(-1, 6))
    found = np.isfinite(hits.t)
    label = np.where(
        found, np.array([*labels, 0])[np.where(found, hits.mesh, len(labels)).astype(np.int64)], 0
    )
    moves = (label >= labels_seen[0]) & (label <= labels_seen[1])
    measured = moves & (hits.t > NEAREST) & (hits.t < FARTHEST)
    return Seen(float(moves.mean()), float(measured.mean()), caster.distance(stage.cameras[k][:3, 3]))


def _reach(stage: Stage) -> float:
    """The median distance of the wrist from the shoulder while the hand is there, metres."""
    there = np.flatnonzero(stage.hand.present)
    if len(there) == 0:
        return 0.0
    return float(np.median([stage.shoulder_distance(int(i)) for i in there]))
