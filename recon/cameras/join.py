"""Pieces of a path joined: after a covered lens or a blank wall a place is recognised again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.cameras.places import Keyframe, Seen, keyframes_of, places_seen_again, sharpness
from recon.cameras.submaps import Piece
from recon.recording import Recording
from twin import geometry as geo
from twin.geometry import Array
from twin.runs.threads import each

# s between keyframes. Chosen by us: at .6 m/s half of the view is still the same.
KEYFRAME_S = 0.8
# m and rad within which two recognised places agree on how pieces lie: several keyframes' drift.
_SAME_M = 0.05
_SAME_RAD = float(np.radians(3.0))
# Recognised places that must agree.
_VOTES = 2


def keyframes_every(recording: Recording, frames: NDArray[np.int64]) -> list[Keyframe]:
    """Keyframes among rising frames (n,): the one with the sharpest picture of each `KEYFRAME_S`."""
    times = np.asarray(recording.times)[frames]
    slot = np.floor((times - times[:1]) / KEYFRAME_S)
    sharp = np.array(list(each(lambda f: sharpness(recording, f), frames.tolist())))
    order = np.lexsort((-sharp, slot))
    _, first = np.unique(slot[order], return_index=True)
    return keyframes_of(recording, frames[order[first]].tolist())


def joined(recording: Recording, pieces: Sequence[Piece]) -> tuple[Piece, ...]:
    """The pieces, the largest first, with those joined to it that two places or more place alike.

    How odometry has bridged a hole counts as a place. Of pieces that places which look alike don't join, all
    keyframes are compared with all others.
    """
    if len(pieces) < 2:
        return tuple(pieces)
    keys = keyframes_every(recording, np.sort(np.concatenate([p.frames for p in pieces])))
    of = {int(f): k for k, p in enumerate(pieces) for f in p.frames}
    number = np.array([of[k.frame] for k in keys])
    others = number[:, None] != number
    loops = places_seen_again(keys, others, recording.intrinsics)
    loops += [p.bridge for p in pieces if p.bridge is not None]
    whole, left = _put_together(pieces, loops)
    if left:
        alone = np.isin([k.frame for k in keys], np.concatenate([p.frames for p in left]))
        others &= alone[:, None] | alone
        every = [*loops, *places_seen_again(keys, others, recording.intrinsics, candidates=None)]
        loops = list({(s.a, s.b, s.matches): s for s in every}.values())  # a place has one vote
        whole, left = _put_together((whole, *left), loops)
    return (whole, *left)


def _put_together(pieces: Sequence[Piece], loops: Sequence[Seen]) -> tuple[Piece, list[Piece]]:
    """The largest piece with all that these places join to it, and the others."""
    left = sorted(pieces, key=lambda p: -len(p.frames))
    whole = left.pop(0)
    while True:
        lays = [(k, lay) for k, p in enumerate(left) if (lay := _lay(whole, p, loops)) is not None]
        if not lays:
            return whole, left
        k, lay = lays[0]
        whole = _both(whole, left.pop(k), lay)


def _lay(whole: Piece, piece: Piece, loops: Sequence[Seen]) -> Array | None:
    """T_whole_piece (4, 4) that most places agree on, None where too few do."""
    there = {int(f): pose for f, pose in zip(whole.frames, whole.poses, strict=True)}
    here = {int(f): pose for f, pose in zip(piece.frames, piece.poses, strict=True)}
    told = [there[s.a] @ s.T_a_b @ geo.invert_pose(here[s.b]) for s in loops if s.a in there and s.b in here]
    told += [there[s.b] @ geo.invert_pose(here[s.a] @ s.T_a_b) for s in loops if s.b in there and s.a in here]
    if len(told) < _VOTES:
        return None
    poses = np.stack(told)
    centre = piece.poses[:, :3, 3].mean(axis=0)
    off = geo.invert_pose(poses)[:, None] @ poses[None]
    moved = geo.transform(poses, centre[None])[:, 0]
    near = np.linalg.norm(moved[:, None] - moved[None], axis=-1) < _SAME_M
    near &= geo.rotation_angle(off[..., :3, :3]) < _SAME_RAD
    best = int(np.argmax(near.sum(axis=1)))
    if near[best].sum() < _VOTES:
        return None
    agreed = poses[near[best]]
    about = poses[best]
    return np.asarray(about @ geo.exp_se3(geo.log_se3(geo.invert_pose(about) @ agreed).mean(axis=0)))


def _both(whole: Piece, piece: Piece, lay: Array) -> Piece:
    """One piece of two; frames that both have, too few to join them by, are the first one's."""
    new = ~np.isin(piece.frames, whole.frames)
    frames = np.concatenate([whole.frames, piece.frames[new]])
    order = np.argsort(frames)
    return Piece(frames[order], np.concatenate([whole.poses, lay @ piece.poses[new]])[order])
