"""Runs CoACD on one mesh, as a program: coacd_worker.py MESH.npz PIECES.npz SECONDS (limit of CPU time)."""

from __future__ import annotations

import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

# preprocess off: the mesh is closed already. real_metric: the threshold is in metres, not a share of the
# body's size. 60 search steps, less than the default 150, find the same pieces of furniture in half the time.
SETTINGS: dict[str, Any] = {"preprocess_mode": "off", "real_metric": True, "mcts_iterations": 60, "seed": 0}


def main(given: Path, result: Path, seconds: int) -> int:
    import coacd

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    coacd.set_log_level("off")
    with np.load(given, allow_pickle=False) as data:
        mesh = coacd.Mesh(data["vertices"], data["faces"])
        settings = SETTINGS | {k.removeprefix("set_"): data[k].item() for k in data if k.startswith("set_")}
        pieces = coacd.run_coacd(
            mesh, threshold=float(data["tolerance"]), max_convex_hull=int(data["most"]), **settings
        )
    arrays: dict[str, Any] = {"count": np.array(len(pieces))}
    for k, (vertices, faces) in enumerate(pieces):
        arrays |= {f"{k}_vertices": vertices, f"{k}_faces": faces.astype(np.int32)}
    np.savez(result, **arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])))
