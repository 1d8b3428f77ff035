"""Times `twin export` on twins with very fine meshes, each in a process of its own, and writes
large_meshes.md.

    python benchmarks/large_meshes.py WORK [FACES ...]

WORK is a folder for the runs. The meshes are noisy boards cut finely, as a scanner leaves them
(benchmarks/scenes/large_meshes.py).
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.scenes.boards import cabinet_twin
from benchmarks.scenes.large_meshes import fine_boards, fine_scene
from twin.scene import Mesh, Twin
from twin.storage import save

PAGE = Path(__file__).with_suffix(".md")
ROOT = Path(__file__).resolve().parents[1]
LIMIT = 600  # s on the clock


def finest(make: Callable[[int], Mesh], faces: int) -> Mesh:
    """The mesh of this kind with at least `faces` triangles: the generators stop below what they are asked
    for."""
    asked = faces
    while True:
        mesh: Mesh = make(asked)
        if len(mesh.faces) >= faces:
            return mesh
        asked *= 2


def twin_of(mesh: Mesh, where: str) -> Twin:
    """A cabinet whose door, or whose static scene, is the mesh, with nothing filled in."""
    twin = cabinet_twin()
    parts = [replace(p, collision=(), inertial=None, physics=None, contact=None) for p in twin.parts]
    static = replace(twin.static, collision=())
    if where == "part":
        parts[0] = replace(parts[0], mesh=mesh)
    else:
        static = replace(static, mesh=mesh)
    return replace(twin, static=static, parts=tuple(parts))


def timed(run: Path) -> tuple[float, float, str]:
    """Seconds on the clock and of processors of one export, and how it ended."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "twin", "export", str(run)], cwd=ROOT, capture_output=True, text=True,
            timeout=LIMIT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        said = "exported" if done.returncode == 0 else done.stderr.strip().splitlines()[-1]
    except subprocess.TimeoutExpired:
        said = f"not done after {LIMIT} s"
    wall = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, said


def main(work: Path, counts: list[int]) -> None:
    rows = []
    for faces in counts:
        jobs = [("noisy boards", fine_boards, "part"), ("noisy boards", fine_scene, "static scene")]
        for name, make, where in jobs:
            mesh = finest(make, faces)
            run = work / f"{name}_{where}_{faces}".replace(" ", "_")
            save(twin_of(mesh, where), run / "twin")
            wall, cpu, said = timed(run)
            rows.append(f"| {name} | {where} | {len(mesh.faces):,} | {wall:.0f} | {cpu:.0f} | {said} |")
            print(rows[-1], flush=True)
    PAGE.write_text(
        "# Very fine meshes\n\n"
        f"`twin export` as a whole: collision shapes, mass, three formats, the page. Written by `benchmarks/large_meshes.py`; "
        f"{os.cpu_count()} cores, load {os.getloadavg()[1]:.0f} over\nfive minutes at the end. Each mesh is the first of its kind "
        f"with at least {' or '.join(f'{n:,}' for n in counts)} triangles.\n\n"
        "| mesh | where | faces | s | s of processors | |\n|---|---|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), [int(n) for n in sys.argv[2:]] or [200_000, 1_000_000])
