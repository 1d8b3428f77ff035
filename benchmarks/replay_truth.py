"""Franka on the true geometry of the shipped recording and those in $FUNTWIN_DATA: planning and replay by themselves.

    FUNTWIN_DATA=... python benchmarks/replay_truth.py [--video FOLDER] [--errors]

--errors adds contacts that are off by 1, 2 and 3 cm. Prints one row a replay.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh

import robots
from twin import geometry as geo
from twin.errors import FuntwinError
from twin.scene import ContactPath, Joint, Mesh, Motion, Part, Prismatic, Revolute, StaticPart, Twin

NAMES = ("kitchen_hinge", "kitchen_slide", "kitchen_microwave")
ERRORS = (0.01, 0.02, 0.03)
SEEDS = 4


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
    contact = ContactPath(
        grip[:3, 3], np.stack([np.cross(along, out), along, out], axis=1), 0.04, tuple(held.tolist()), "truth"
    )
    mesh, hulls = _mesh(folder / "truth" / f"part_{part['id']}.ply")
    moving = Part(part["id"], part["name"], mesh, joint, motion, contact=contact, collision=hulls)
    static_mesh, static_hulls = _mesh(folder / "truth" / "static.ply")
    return Twin(folder.name, StaticPart("static", static_mesh, static_hulls), (moving,))


def _mesh(path: Path) -> tuple[Mesh, tuple[Mesh, ...]]:
    """Mesh and the convex hull of each of its connected pieces (the true meshes are made of convex pieces)."""
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
    return ContactPath(contact.point + shift, contact.rotation, contact.width, contact.frames, contact.source)


def contacts(twin: Twin, errors: bool) -> Iterator[tuple[str, ContactPath]]:
    """The true contact and, on request, wrong ones."""
    contact = twin.parts[0].contact
    assert contact is not None
    yield "true contact", contact
    if errors:
        for e in ERRORS:
            for seed in range(SEEDS):
                yield f"{100 * e:.0f} cm off #{seed}", moved(contact, e, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--video", type=Path, help="folder for videos of the true contact")
    parser.add_argument("--errors", action="store_true")
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    folders = sorted((Path(__file__).parent.parent / "assets" / "recordings").glob("*/truth/part_2.ply"))
    if "FUNTWIN_DATA" in os.environ:
        folders += [
            Path(os.environ["FUNTWIN_DATA"]) / "recordings" / n / "truth" / "part_2.ply" for n in NAMES
        ]
    print(
        f"{'recording':18s} {'contact':14s} {'plan s':>6s} {'wall s':>6s} {'x real':>6s} peak final slip track torque margin ok"
    )
    for folder in [f.parent.parent for f in folders if args.only in f.parent.parent.name]:
        name, twin = folder.name, truth_twin(folder)
        for label, contact in contacts(twin, args.errors):
            started = time.perf_counter()
            try:
                trajectory = robots.plan(twin, twin.parts[0].id, contact=contact)
                planned = time.perf_counter() - started
                out = args.video / name if args.video and label == "true contact" else None
                r = robots.replay(twin, trajectory, out, video=out is not None)
            except FuntwinError as e:
                print(f"{name:18s} {label:14s} {e}", flush=True)
                continue
            print(
                f"{name:18s} {label:14s} {planned:6.1f} {r.wall_seconds:6.2f} {r.duration / r.wall_seconds:6.1f} "
                f"{r.opening_peak:4.2f} {r.opening_final:5.2f} {r.slip_mm:4.1f} {r.tracking_max_mm:5.1f} "
                f"{max(r.torque_share):6.2f} {r.limit_margin:6.2f} {r.ok!s:5s} {r.reason} [{r.grasp}; pedestal {r.pedestal:.2f}]"
                f" {[(u.bodies, u.samples) for u in r.unintended[:2]]}",
                flush=True,
            )


if __name__ == "__main__":
    main()
