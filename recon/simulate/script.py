"""What a simulated recording shows: whose parts are moved, how, and what else goes on meanwhile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from recon.simulate.actors import Actor
from recon.simulate.acts import Act
from recon.simulate.config import Staging
from recon.simulate.grip import find_grasp
from recon.simulate.mjcf import Articulation, articulations
from recon.simulate.surfaces import Surface
from recon.simulate.timeline import Episode, timelines
from twin.geometry import Array, invert_pose, transform


class Happening:
    """Something that goes on besides; alone it is nothing at all."""

    def act(self, act: Act) -> Act:
        """What the camera looks at and the hand goes to, in place of the part."""
        return act

    def leads(self, act: Act, cameras: Array) -> Array | None:  # noqa: ARG002  (for those who need it)
        """The hand's poses T_world_hand (frames, 4, 4) while it is in view; None: it holds the part."""
        return None

    def actors(self, act: Act, cameras: Array, bounds: tuple[Array, Array]) -> list[Actor]:  # noqa: ARG002
        """What is rendered besides."""
        return []


NOTHING_ELSE = Happening()


@dataclass(frozen=True)
class Script:
    """episodes: the interactions one after the other; the first one's part decides where the person stands.
    rest_after_s: after the last. happening: what else goes on; its parts are then no parts, and the truth has
    none. cut_s: taken away at the beginning and at the end of the recording, seconds.
    """

    model: mujoco.MjModel
    source: str
    episodes: tuple[Episode, ...]
    rest_after_s: float
    happening: Happening = NOTHING_ELSE
    moves_parts: bool = True
    cut_s: tuple[float, float] = (0.0, 0.0)

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that are moved, each once, in the order of their first episodes."""
        return tuple(dict.fromkeys(e.joint for e in self.episodes))


def load_parts(script: Script, config: Staging, rng: np.random.Generator) -> tuple[Articulation, ...]:
    """The parts of the script's joints. Raises InputError when one doesn't exist or moves nothing."""
    return articulations(script.model, script.source, script.joints, config.exclude, config.textures, rng)


def acts_of(
    script: Script, parts: Sequence[Articulation], config: Staging, rng: np.random.Generator
) -> tuple[Act, ...]:
    """The script's interactions in place. Raises ConfigError, InputError when they don't fit the parts."""
    lines = timelines(script.episodes, script.rest_after_s, config)
    index = {joint: k for k, joint in enumerate(script.joints)}
    states: dict[str, Array] = {}
    for episode, line in zip(script.episodes, lines, strict=True):
        moved = line.states(episode.levels)
        before = states.get(episode.joint)
        states[episode.joint] = moved if before is None else before + moved - moved[0]
    out = []
    for episode, line in zip(script.episodes, lines, strict=True):
        part = parts[index[episode.joint]]
        scene = among(part, parts, {name: float(s[line.start]) for name, s in states.items()})
        grasp = find_grasp(scene, config.handle, rng)
        out.append(Act(scene, grasp, line, states[episode.joint], episode.reaches))
    return tuple(out)


def among(part: Articulation, parts: Sequence[Articulation], states: Mapping[str, float]) -> Articulation:
    """A part for which the others stand still at their `states`, by name, rad or m."""
    others = [
        posed(s, other.pose(states[other.name])) for other in parts if other is not part for s in other.part
    ]
    return replace(part, static=(*part.static, *others)) if others else part


def posed(surface: Surface, pose: Array) -> Surface:
    """A surface moved by `pose` (4, 4) together with its texture."""
    normals = surface.corner_normals
    return replace(
        surface,
        vertices=transform(pose, surface.vertices),
        T_texture_object=surface.T_texture_object @ invert_pose(pose),
        corner_normals=None if normals is None else normals @ pose[:3, :3].T,
    )
