"""Write recordings with truth in other layouts, reconstruct from these, and compare with the twin of the
original.

    python benchmarks/formats.py WORK RECORDING [RECORDING ...] [--only tum mkv] [--long] [--page FILE]

Layouts that hold every pixel (tum, ROS 1, MCAP, .mkv) should give the original's joint; those of phones,
whose depth has 256x192 pixels, are judged by the truth. --long also writes each layout once more with 2700
frames (the first recording played forth and back) and measures what opening it and decoding the first frame
takes, in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import recon
from benchmarks.layouts.azure_kinect import write_azure_kinect
from benchmarks.layouts.phones import write_r3d, write_stray
from benchmarks.layouts.ros import write_ros1, write_ros2
from recon.evaluation.evaluate import evaluate
from recon.recording.write import write_recording
from twin import geometry as geo
from twin.errors import FuntwinError
from twin.scene import Prismatic, Twin
from twin.storage import load

LONG = 2700  # frames: three minutes at 15 a second
WRITERS: dict[str, tuple[str, Callable[[recon.Recording, Path], Any]]] = {
    "tum": ("tum", lambda r, out: write_recording(r, out, "tum")),
    "ros1": ("ros1.bag", write_ros1),
    "mcap": ("ros2", lambda r, out: write_ros2(r, out, storage="mcap")),
    "mkv": ("kinect.mkv", write_azure_kinect),
    "stray": ("stray", write_stray),
    "r3d": ("clip.r3d", write_r3d),
}
EXACT = ("tum", "ros1", "mcap", "mkv")
_OPEN = """
import resource, sys, time
import recon, recon.readers, recon.dense.registration, cv2, av, rosbags.highlevel, rosbags.typesys
def memory(): return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
before, start = memory(), time.perf_counter()
recording = recon.open_recording(sys.argv[1])
recording.frame(0)
first = time.perf_counter() - start
for k in (1, 2, len(recording) // 2, len(recording) - 1):
    recording.frame(k)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
print(len(recording), first, (peak - before) / 2**20)
"""


def written(recording: recon.Recording, layout: str, folder: Path) -> Path:
    """The recording in another layout; what is there already stays."""
    name, write = WRITERS[layout]
    out = folder / name
    if not out.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write(recording, out)
    return out


def reconstructed(recording: Path, run: Path) -> tuple[Twin, float]:
    """The twin of `twin reconstruct` in a process of its own, and its wall seconds."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "twin", "reconstruct", str(recording), "-o", str(run), "--json"],
        check=False,
        stdout=subprocess.DEVNULL,
    )
    return load(run), time.perf_counter() - start


def against(original: Twin, found: Twin) -> dict[str, Any]:
    """How far the first part's joint is from the original's: axis (degrees) and states (degrees or mm,
    mean)."""
    if len(original.parts) != len(found.parts) or not found.parts or found.cameras is None:
        return {"axis": np.nan, "state": np.nan, "unit": f"{len(found.parts)} parts"}
    assert original.cameras is not None
    first = int(np.intersect1d(original.cameras.frames, found.cameras.frames)[0])
    a, b = original.cameras.pose(first), found.cameras.pose(first)
    assert a is not None
    assert b is not None
    one, other = original.parts[0], found.parts[0]
    axis = geo.line_angle(one.joint.axis, geo.rotate(a @ geo.invert_pose(b), other.joint.axis))
    _, i, j = np.intersect1d(one.motion.frames, other.motion.frames, return_indices=True)
    off = float(np.mean(np.abs(one.motion.state[i] - other.motion.state[j])))
    slides = isinstance(one.joint, Prismatic)
    return {
        "axis": float(np.rad2deg(axis)),
        "state": off * 1000 if slides else float(np.rad2deg(off)),
        "unit": "mm" if slides else "deg",
    }


def by_truth(twin: Twin, truth: Path) -> dict[str, Any]:
    """Axis and pivot against the truth, and whether both are within 5 degrees and 2 cm."""
    rows = {r.metric: r.value for r in evaluate(twin, truth).rows if r.part != "all parts"}
    axis, pivot = rows.get("axis", np.nan), rows.get("pivot, line to line", 0.0)
    right = rows.get("type right") == 1 and axis <= 5 and pivot <= 20
    return {"axis to truth": axis, "pivot to truth": pivot, "success": bool(right)}


def round_trips(folder: Path, recording: Path, layouts: list[str]) -> list[dict[str, Any]]:
    opened = recon.open_recording(recording)
    original, seconds = reconstructed(recording, folder / "run_native")
    rows = [
        {
            "recording": opened.name,
            "layout": "native",
            "s": seconds,
            **by_truth(original, recording / "truth"),
        }
    ]
    for layout in layouts:
        row: dict[str, Any] = {"recording": opened.name, "layout": layout}
        try:
            clip = written(opened, layout, folder)
            found, row["s"] = reconstructed(clip, folder / f"run_{layout}")
            row |= against(original, found) | by_truth(found, recording / "truth")
        except FuntwinError as error:
            row["error"] = str(error)
        rows.append(row)
        print(json.dumps(row), flush=True)
    return rows


def forth_and_back(recording: recon.Recording, count: int) -> recon.Recording:
    """`count` frames of a recording, played forth and back, at its own pace."""
    n = len(recording)
    order = np.abs((np.arange(count) + n - 1) % (2 * n - 2) - (n - 1))
    step = float(np.median(np.diff(recording.times)))
    return replace(
        recording,
        times=np.arange(count) * step,
        read_color=lambda k: recording.color(int(order[k])),
        read_depth=lambda k: recording.depth(int(order[k])),
        poses=None,
    )


def opening(clip: Path) -> dict[str, float]:
    """Frames, seconds to the first frame, and MB above the imports, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", _OPEN, str(clip)], check=True, capture_output=True, text=True
    )
    frames, seconds, megabytes = map(float, done.stdout.split())
    return {"frames": frames, "first frame s": seconds, "MB": megabytes}


def page(rows: list[dict[str, Any]], long: dict[str, dict[str, float]]) -> str:
    """The page: round trips, then opening."""
    lines = [
        "# Other layouts, measured",
        "",
        "`python benchmarks/formats.py WORK RECORDING... --long` writes this page: recordings with truth (looked at while this program was built)",
        "in other layouts, by scripts that share no code with the readers, reconstructed from these. Layouts with every pixel are",
        "compared with the original's twin (bar: axis .1 degrees, state .1 degrees or 1 mm); those with a phone's 256x192 depth with the truth",
        "(bar: type right, axis 5 degrees, pivot 2 cm; axis 1 degree). Seconds are of `twin reconstruct`, once.",
        "",
        "| recording | layout | axis to original ° | state to original | axis to truth ° | pivot to truth mm | success | s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        if "error" in r:
            lines.append(f"| {r['recording']} | {r['layout']} | {r['error']} | | | | no | |")
            continue
        own = "" if "axis" not in r else f"{r['axis']:.3f}"
        state = "" if "state" not in r else f"{r['state']:.3f} {r['unit']}"
        pivot = r["pivot to truth"]
        lines.append(
            f"| {r['recording']} | {r['layout']} | {own} | {state} | {r['axis to truth']:.3f} | {pivot:.1f} | "
            f"{'yes' if r['success'] else 'no'} | {r['s']:.1f} |"
        )
    if long:
        lines += [
            "",
            f"Opening {LONG} frames of 640x480 and decoding the first one, in a process of its own; memory above the imports, five frames decoded:",
            "",
            "| layout | frames | first frame s | MB |",
            "|---|---|---|---|",
            *(
                f"| {name} | {v['frames']:.0f} | {v['first frame s']:.2f} | {v['MB']:.0f} |"
                for name, v in long.items()
            ),
        ]
    return "\n".join(lines) + "\n"


def main(argv: list[str]) -> int:
    """Measure and write the page; 0 when done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", choices=tuple(WRITERS), default=list(WRITERS))
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--page", type=Path, default=Path(__file__).with_suffix(".md"))
    options = parser.parse_args(argv)
    rows = [row for r in options.recordings for row in round_trips(options.work / r.name, r, options.only)]
    long = {}
    if options.long:
        clip = forth_and_back(recon.open_recording(options.recordings[0]), LONG)
        for layout in options.only:
            long[layout] = opening(written(clip, layout, options.work / "long"))
            print(layout, long[layout], flush=True)
    options.page.write_text(page(rows, long), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
