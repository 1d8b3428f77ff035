"""Joint types from a vision-language model that sees a few frames of the recording (extra `vlm`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.interaction.joints.type_selection import TypeHint
from recon.models.joint_hint import read_hints
from recon.recording import Recording
from twin.vlm.cache import ask_once
from twin.vlm.client import DEFAULT, Limits, Question, endpoint_from_environment
from twin.vlm.picture import jpeg

INSTRUCTIONS = """\
You see frames of a recording, in their order, in which a person's hand opens or closes furniture or an appliance. Name each part
that moves, whether it turns on a hinge (revolute) or slides (prismatic), and between which frames it moves. Say unknown where you
can't tell. The camera moves too: do not take that for a part. Answer with one JSON object and nothing else:
{"parts": [{"object_name": text, "joint_type": "revolute" | "prismatic" | "unknown", "first_frame": number, "last_frame": number}]}
with frame numbers as the text counts them.
"""


@dataclass(frozen=True)
class VlmJointHint:
    """Asks the environment's endpoint. frames: how many pictures. longest: their px; chosen by us."""

    frames: int = 8
    longest: int = 512
    model: str | None = None
    limits: Limits = DEFAULT

    def __call__(self, recording: Recording, folder: Path | None) -> tuple[TypeHint, ...]:
        """Raises InputError without key or model; ServiceError for an answer that can't be used."""
        endpoint = endpoint_from_environment(self.model)
        last = len(recording) - 1
        chosen = sorted({int(f) for f in np.linspace(0, last, self.frames).round()})
        text = f"The recording has frames 0 to {last}. You see, in this order, frames {', '.join(map(str, chosen))}."
        pictures = tuple(jpeg(recording.color(f), self.longest) for f in chosen)
        question = Question(INSTRUCTIONS, text, pictures)
        return ask_once(
            question,
            endpoint,
            lambda answer: read_hints(answer, last + 1, endpoint.model),
            folder,
            limits=self.limits,
        ).value
