"""The parts that the user points at or gives intervals of, beside those that were found without a word.

A found part that moves while a said one does gives way: a hand moves one part at a time, and the user knows
which.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from recon.interaction.boards.meanwhile import MEANWHILE, together
from recon.interaction.joints.config import JointConfig
from recon.interaction.joints.observations import Kind
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.parts.find_parts import Search, moving_part_of
from recon.interaction.parts.found import FoundParts, PartTracks
from recon.interaction.parts.hand_tracks import HandTracks
from recon.interaction.parts.said_parts import Observed, outside, search_space
from recon.interaction.parts.static_spans import rest_spans
from recon.interaction.parts.two_witnesses import reconciled_word
from recon.recording import Recording
from recon.recording.said import JointWord, Said
from recon.tracking.tracks import Tracks
from twin.errors import ReconstructionError
from twin.runs.keys import Stage
from twin.scene import FIRST_PART_ID, Motion, Trajectory

SAID = Stage("said", 1, ("joints",))


def with_words(
    recording: Recording,
    tracks: Tracks,
    cameras: Trajectory,
    found: FoundParts,
    joints: JointConfig,
    hints: Sequence[TypeHint],
    said: Said,
) -> FoundParts:
    """The said parts, in the order of the words, then those found without that move when none of these does.

    hints: expected types, where the user says none. A warning for each word without a part.
    """
    seen = Observed(recording, tracks, cameras, found.movers, joints)
    by_word = _said_parts(seen, hints, said)
    others = [f for f in found.parts if not any(_meanwhile(f.part.motion, s.part.motion) for s in by_word)]
    parts = chain(by_word, others)
    return FoundParts(
        found.movers,
        tuple(replace(p, part=replace(p.part, id=FIRST_PART_ID + k)) for k, p in enumerate(parts)),
    )


def hints_of(word: JointWord | None, hints: Sequence[TypeHint]) -> Sequence[TypeHint]:
    """The type that the user says, else what others expect."""
    kind = _kind(word)
    return hints if kind is None else (TypeHint(kind, 0, 1, "the user", weight=np.inf),)


def _kind(word: JointWord | None) -> Kind | None:
    return None if word is None else "revolute" if word == "hinge" else "prismatic"


def _meanwhile(motion: Motion, of_word: Motion) -> bool:
    """Whether either of two parts moves only while the other one does, for the most part."""
    state, other = (np.interp(motion.frames, m.frames, m.state) for m in (motion, of_word))
    return max(together(state, other), together(other, state)) >= MEANWHILE


def _said_parts(seen: Observed, hints: Sequence[TypeHint], said: Said) -> list[PartTracks]:
    """The part of each of the user's words, among tracks that no earlier word explains."""
    parts: list[PartTracks] = []
    movers, frames = seen.movers, len(seen.movers.visible)
    hand_of = HandTracks(seen.recording, seen.cameras, seen.tracks).of
    to_part = moving_part_of(seen.recording, seen.cameras)
    free, hand = movers.moving.copy(), np.zeros_like(movers.moving)
    intervals = [word.interval for word in said.words if word.interval is not None]
    # What moves outside of all intervals: another part, where a word says none.
    outsiders = hand_of(outside(intervals, frames)) if intervals else hand

    def lies_on_hand(_: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
        return hand

    for word in said.words:
        word = replace(word, type=word.type or said.type)
        expected = hints_of(word.type, hints)
        hand = np.zeros_like(hand) if word.interval is None else outsiders
        found, why = None, None
        try:
            where = search_space(word, seen, free & ~hand, expected)
            if word.interval is None and where.fit is not None:  # now it is known when it rests
                hand = hand_of(rest_spans(where.fit.fit, frames))
                where = search_space(word, seen, free & ~hand, expected)
            search = Search(where.movers, lies_on_hand, to_part, seen.joints, expected)
            search.free &= where.group
            if not search.take(where.group, where.fit):
                raise search.failed[0]
            (found,) = search.found
        except ReconstructionError as e:
            why = e
        part = reconciled_word(found, word, _kind(word.type), seen.recording, seen.cameras, movers)
        if part is None:
            warnings.warn(f"no part was found for {word}: {why}", stacklevel=3)
            continue
        parts.append(part)
        free &= ~part.members
    return parts
