"""Measure collision shapes against true parts and print one table of each kind.

    python benchmarks/collision.py --truth RECORDING/truth ... [--twin TWIN RECORDING/truth] ... \
        [--table FILE]

"true mesh": shapes made from the true part mesh, measured against it. "reconstructed": shapes made from a
twin's part, measured against the true part after the worlds are aligned by the cameras. --coacd adds CoACD
against our own splitter. The solid of a true part is the union of what its closed pieces enclose
(twin.collision.solid). Contacts are those that MuJoCo finds in 61 states of each part's range, exclusions and
its own filter between parent and child removed, one file a format. Seconds are of one core: processor, and on
the clock.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from recon.evaluation.read_truth import load_truth
from recon.evaluation.scores import camera_errors, match_parts
from recon.evaluation.truth import Truth
from twin.collision import (
    PART_BOARDS,
    PART_FACES,
    CollisionConfig,
    cover,
    decimated,
    make_part,
    surface_hulls,
    with_collision,
)
from twin.collision.boards import beyond, find_boards
from twin.collision.closed_pieces import closed_piece_shapes, coacd_pieces, outward
from twin.collision.convex import triangles_of
from twin.collision.fit import Fit, fit_of
from twin.collision.main_axes import outline_axes
from twin.collision.pieces import pieces_of
from twin.collision.solid import Solid
from twin.errors import FuntwinError
from twin.exporters import FORMATS, export
from twin.scene import Box, Collision, Mesh, Part, Twin
from twin.storage import load

STATES = 61
CONFIG = CollisionConfig()


@dataclass(frozen=True)
class Measured:
    """One part: its shapes' fit to the true part, how many are boxes, seconds, contacts by format."""

    recording: str
    part: str
    fit: Fit
    boxes: int
    cpu: float
    wall: float
    contacts: dict[str, int] | None = None


def moved(shape: Collision, T: np.ndarray) -> Collision:
    """A shape in another frame."""
    return shape.transformed(T) if isinstance(shape, Mesh) else Box(T @ shape.T_world_box, shape.size)


def timed(make: Callable[[], list[Collision]]) -> tuple[list[Collision], float, float]:
    """What `make` gives, seconds of processor time, those of its processes included, and seconds on the
    clock."""
    cpu, wall = os.times(), time.perf_counter()
    shapes = make()
    return shapes, sum(os.times()[:4]) - sum(cpu[:4]), time.perf_counter() - wall


def timed_shapes(mesh: Mesh) -> tuple[list[Collision], float, float]:
    return timed(lambda: list(make_part(mesh, CONFIG).shapes))


def true_meshes(truth: Truth) -> list[Measured]:
    """Shapes of the true meshes against themselves."""
    out = []
    for part in truth.parts:
        shapes, cpu, wall = timed_shapes(part.mesh)
        fit = fit_of(shapes, Solid.of_mesh(part.mesh))
        boxes = sum(isinstance(s, Box) for s in shapes)
        out.append(Measured(truth.folder.parent.name, part.name, fit, boxes, cpu, wall))
    return out


def reconstructed(twin: Twin, truth: Truth) -> list[Measured]:
    """Shapes of the parts of a twin against the true parts, and contacts in the exported files."""
    if twin.cameras is None:
        raise FuntwinError(f"twin {twin.name} has no cameras", "give one that was reconstructed")
    T = camera_errors(twin.cameras, truth).T_truth_recon
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, truth)
    shaped = with_collision(twin, renew=True)
    found = contacts(shaped)
    out = []
    for i, j in sorted(pairs.items()):
        true, part = truth.parts[i], shaped.parts[j]
        _, cpu, wall = timed_shapes(part.mesh)
        fit = fit_of([moved(s, T) for s in part.collision], Solid.of_mesh(true.closed_mesh))
        boxes = sum(isinstance(s, Box) for s in part.collision)
        out.append(Measured(truth.folder.parent.name, true.name, fit, boxes, cpu, wall, found[part.name]))
    return out


def contacts(twin: Twin) -> dict[str, dict[str, int]]:
    """Contacts of each part with anything, by format, summed over its range while it alone opens."""
    out: dict[str, dict[str, int]] = {p.name: {} for p in twin.parts}
    with tempfile.TemporaryDirectory() as folder:
        files = export(twin, Path(folder))
        for fmt in FORMATS:
            model = unfiltered(files[fmt], fmt)
            for part in twin.parts:
                out[part.name][fmt] = sweep(model, part)
    return out


def unfiltered(path: Path, fmt: str) -> Any:
    """The file as MuJoCo model in which every pair of bodies may touch."""
    import mujoco

    if fmt == "usd":
        import_module("mujoco._usd")  # registers the schemas: before any other use of pxr in this process
    spec = mujoco.MjSpec.from_file(str(path))
    for exclude in list(spec.excludes):
        spec.delete(exclude)
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    return spec.compile()


def sweep(model: Any, part: Part) -> int:
    import mujoco

    data = mujoco.MjData(model)
    joints = {model.joint(j).name.split("/")[-1]: j for j in range(model.njnt)}
    address = int(model.jnt_qposadr[joints[f"{part.name}_joint"]])
    count = 0
    for state in np.linspace(part.joint.lower, part.joint.upper, STATES):
        data.qpos[:] = 0.0
        data.qpos[address] = state
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        count += sum(c.dist < 0 for c in data.contact)
    return count


def united(mesh: Mesh) -> Mesh:
    """The closed pieces of a mesh as one body, as a CAD model would have it."""
    pieces = [outward(m) for m, closed in pieces_of(mesh) if closed]
    bodies = [trimesh.Trimesh(m.vertices, m.faces) for m in pieces if m is not None]
    whole = trimesh.boolean.union(bodies, engine="manifold")
    return Mesh(np.asarray(whole.vertices), np.asarray(whole.faces, dtype=np.int32))


def compared_bodies(truth: Truth) -> list[Measured]:
    """Every true part as one closed body: covered as scans are, and split by CoACD."""
    out = []
    for part in truth.parts:
        body = united(part.mesh)
        ways = {"scan splitter": lambda b=body: as_scan(b), "CoACD": lambda b=body: closed_body(b)}
        for name, way in ways.items():
            shapes, cpu, wall = timed(way)
            fit, boxes = fit_of(shapes, Solid.of_mesh(body)), sum(isinstance(s, Box) for s in shapes)
            out.append(Measured(truth.folder.parent.name, name, fit, boxes, cpu, wall))
    return out


def closed_body(body: Mesh) -> list[Collision]:
    return closed_piece_shapes(body, CONFIG.tolerance, CONFIG.part_pieces) or []


def as_scan(mesh: Mesh) -> list[Collision]:
    return cover(triangles_of(decimated(mesh, PART_FACES)), CONFIG, CONFIG.part_pieces)[0]


def compared_leftovers(twin: Twin, truth: Truth) -> list[Measured]:
    """What boards leave of a reconstructed part, an open surface: our splitter, and CoACD after it closed the
    surface."""
    T = camera_errors(twin.cameras, truth).T_truth_recon if twin.cameras else np.eye(4)
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, truth)
    out = []
    for i, j in sorted(pairs.items()):
        triangles = triangles_of(decimated(twin.parts[j].mesh, PART_FACES))
        boards, rest = find_boards(triangles, outline_axes(triangles), PART_BOARDS)
        rest = beyond(rest, [b.box for b in boards], 3 * PART_BOARDS.noise)
        corners, faces = np.unique(rest.reshape(-1, 3).round(7), axis=0, return_inverse=True)
        mesh = Mesh(corners, faces.reshape(-1, 3).astype(np.int32))
        most = CONFIG.part_pieces - len(boards)
        ways = {
            "our splitter": lambda t=rest, m=most: surface_hulls(t, CONFIG, m),
            "CoACD": lambda m=mesh, n=most: list(
                coacd_pieces(m, CONFIG.tolerance, n, preprocess_mode="on", preprocess_resolution=50)
            ),
        }
        true = Solid.of_mesh(truth.parts[i].closed_mesh)
        for name, way in ways.items():
            shapes, cpu, wall = timed(way)
            fit = fit_of([moved(s, T) for s in shapes], true)
            covered = fit_of(shapes, Solid([], [mesh])).missed
            out.append(
                Measured(
                    truth.folder.parent.name, name, replace(fit, missed=covered, ratio=None), 0, cpu, wall
                )
            )
    return out


def table(title: str, rows: list[Measured]) -> str:
    head = ["recording", "part", "shapes", "boxes", "volume ratio", "surface p95", "outside p95", "buried p95", "missed p95",
            "cpu s", "clock s", "contacts"]  # fmt: skip
    lines = [f"## {title}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for r in rows:
        f = r.fit
        ratio = "-" if f.ratio is None else f"{f.ratio:.2f}"
        mm = [f"{1e3 * v:.1f}" for v in (f.surface, f.outside, f.buried or 0.0, f.missed)]
        touch = "" if r.contacts is None else " ".join(f"{k} {v}" for k, v in r.contacts.items())
        lines.append("| " + " | ".join([r.recording, r.part, str(f.shapes), str(r.boxes), ratio, *mm,
                                         f"{r.cpu:.1f}", f"{r.wall:.1f}", touch]) + " |")  # fmt: skip
    return "\n".join(lines) + "\n"


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--truth", type=Path, nargs="+", default=[], help="truth folders: their true meshes")
    parser.add_argument("--twin", type=Path, nargs=2, action="append", default=[], metavar=("TWIN", "TRUTH"))
    parser.add_argument(
        "--coacd", action="store_true", help="also CoACD against our splitter, closed and open"
    )
    parser.add_argument("--table", type=Path, help="also write the tables here")
    options = parser.parse_args(argv)
    text = []
    if options.truth:
        rows = [r for t in options.truth for r in true_meshes(load_truth(t))]
        text.append(table("Shapes of true meshes, in millimetres", rows))
        print(text[-1], flush=True)
    if options.twin:
        rows = [r for run, t in options.twin for r in reconstructed(load(run), load_truth(t))]
        text.append(table("Shapes of reconstructed parts, in millimetres", rows))
        print(text[-1], flush=True)
    if options.coacd and options.truth:
        rows = [r for t in options.truth for r in compared_bodies(load_truth(t))]
        text.append(table("True parts united into one closed body", rows))
        print(text[-1], flush=True)
    if options.coacd and options.twin:
        rows = [r for run, t in options.twin for r in compared_leftovers(load(run), load_truth(t))]
        text.append(table("What boards leave of reconstructed parts", rows))
        print(text[-1], flush=True)
    if options.table:
        options.table.write_text("\n".join(text))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
