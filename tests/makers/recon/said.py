"""The parts of a recording with the user's word, as an interaction finds them."""

from __future__ import annotations

from recon.interaction.joints.config import JointConfig
from recon.interaction.parts.config import MotionConfig
from recon.interaction.parts.find_parts import FoundParts, find_parts
from recon.interaction.parts.words import hints_of, with_words
from recon.recording import Recording
from recon.recording.said import Said
from recon.tracking.tracks import Tracks
from twin.scene import Trajectory


def parts_with(
    recording: Recording, tracks: Tracks, cameras: Trajectory, said: Said | None = None, most: int = 4
) -> FoundParts:
    """most: parts that are found without a word."""
    said = said or Said()
    hints = hints_of(said.type, ())
    found = find_parts(recording, tracks, cameras, MotionConfig(max_parts=most), hints=hints)
    if not said.parts:
        return found
    return with_words(recording, tracks, cameras, found, JointConfig(), (), said)
