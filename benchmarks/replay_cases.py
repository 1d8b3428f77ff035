"""The parts that replays are measured on: random cabinets, true geometry of recordings, reconstructed
runs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.random_furniture import HANDLES, KINDS, random_furniture
from twin import geometry as geo
from twin.exporters import complete
from twin.physics import with_physics
from twin.scene import ContactPath, Joint, Mesh, Motion, Part, Prismatic, Revolute, StaticPart, Twin
from twin.storage import load

RANDOM, TRUE, RECONSTRUCTED = "random cabinet", "true geometry", "reconstructed"


@dataclass(frozen=True)
class Case:
    """One part. origin: where its twin comes from; source: folder of a recording or run, seed of a random
    cabinet."""

    name: str
    origin: str
    source: str

    def twin(self) -> Twin:
        """The twin, complete with masses and shapes; the part is its first."""
        if self.origin == RANDOM:
            kind, handle, seed = self.source.split()
            return random_furniture(kind, handle, int(seed))
        if self.origin == TRUE:
            return with_physics(truth_twin(Path(self.source)))  # its pieces overlap, which exports refuse
        return complete(load(Path(self.source)), Path(self.source) / "stages" / "collision")


def cases(seeds: int, recordings: Sequence[Path], runs: Sequence[Path]) -> Iterator[Case]:
    """Each reconstructed run, the true twin of each recording, `seeds` random cabinets of each kind and
    handle."""
    for run in runs:
        yield Case(run.name, RECONSTRUCTED, str(run))
    for folder in recordings:
        yield Case(folder.name, TRUE, str(folder))
    for kind in KINDS:
        for handle in HANDLES:
            for seed in range(seeds):
                yield Case(f"{kind}, {handle} #{seed}", RANDOM, f"{kind} {handle} {seed}")


def truth_twin(folder: Path) -> Twin:
    """The twin that a perfect reconstruction of a recording would give (first part)."""
    truth = json.loads((folder / "truth" / "truth.json").read_text(encoding="utf-8"))
    part = truth["parts"][0]
    states = np.asarray(part["states"], dtype=np.float64)
    axis = geo.unit(part["axis_world"])
    joint: Joint = (
        Revolute(axis, 0.0, float(states.max()), pivot=np.asarray(part["pivot_world"]))
        if part["type"] == "revolute"
        else Prismatic(axis, 0.0, float(states.max()))
    )
    frames = np.arange(len(states))
    motion = Motion(frames, frames / truth["fps"], states)
    held = np.flatnonzero(truth["hand"]["contact"])
    grip = np.load(folder / "truth" / "hand_keypoints.npz")["T_world_hand"][held[0]]
    # the hand's frame: z along the bar, y towards the part
    along, out = grip[:3, 2], -grip[:3, 1]
    frame = np.stack([np.cross(along, out), along, out], axis=1)
    point = joint.poses(states[held[:1]])[0]  # the first held frame may not be at state 0
    contact = ContactPath(
        geo.transform(geo.invert_pose(point), grip[None, :3, 3])[0], point[:3, :3].T @ frame, 0.04,
        tuple(held.tolist()), "truth",
    )  # fmt: skip
    mesh, hulls = _mesh(folder / "truth" / f"part_{part['id']}.ply")
    moving = Part(part["id"], part["name"], mesh, joint, motion, contact=contact, collision=hulls)
    static_mesh, static_hulls = _mesh(folder / "truth" / "static.ply")
    return Twin(folder.name, StaticPart("static", static_mesh, static_hulls), (moving,))


def _mesh(path: Path) -> tuple[Mesh, tuple[Mesh, ...]]:
    """Mesh and the convex hull of each of its connected pieces (the true meshes are made of convex
    pieces)."""
    m = trimesh.load(path, process=False)
    hulls = []
    for piece in m.split(only_watertight=False):
        if np.ptp(piece.vertices, axis=0).min() > 1e-4:
            hull = piece.convex_hull
            hulls.append(Mesh(hull.vertices, hull.faces))
    return Mesh(m.vertices, m.faces, np.asarray(m.visual.vertex_colors)[:, :3]), tuple(hulls)


def moved(contact: ContactPath, error: float, seed: int) -> ContactPath:
    """The contact shifted by `error` metres in a random direction."""
    shift = geo.unit(np.random.default_rng(seed).normal(size=3)) * error
    return replace(contact, point=contact.point + shift)
