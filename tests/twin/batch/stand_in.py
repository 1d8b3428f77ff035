"""Stands in for the program `twin`: does in no time what a recording's name asks for, and tells who called.

python stand_in.py CALLS VERB RECORDING|RUN ... [-o RUN] --json
"""

import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

SMALL_DISK = 2**28

calls, verb, first, *rest = sys.argv[1:]
source = Path(first)
run = Path(rest[rest.index("-o") + 1]) if "-o" in rest else source
if verb == "simulate":
    run = Path(sys.argv[sys.argv.index("-o") + 1])
with Path(calls).open("a") as file:
    file.write(f"{verb} {run.name} {os.getpid()}\n")
run.mkdir(parents=True, exist_ok=True)
name = run.name
if verb == "simulate":
    (run / "truth").mkdir()
    (run / "truth" / "truth.json").write_text("{}")
elif verb == "reconstruct":
    time.sleep(float(os.environ.get("STAND_IN_SECONDS", "0")))
    if name.startswith("poisoned"):
        sys.stderr.write("twin: depth/000007.png is cut off; copy it again\n")
        sys.exit(1)
    if name.startswith("hangs"):
        time.sleep(600)
    if name.startswith("eats"):
        hoard = []
        while True:
            hoard.append(bytearray(b"x" * 20_000_000))
            time.sleep(0.02)
    if name.startswith("crashes"):
        os.abort()
    if name.startswith("killed"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("worker"):  # its worker dies, every time or the first time
        marked = run / "marked"
        if "once" not in name or not marked.exists():
            marked.touch()
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(600)
    disk = os.statvfs(run)
    if disk.f_blocks * disk.f_frsize < SMALL_DISK and name.startswith(("fills", "late")):
        tried = Path(calls).with_name("tried")  # on another disk
        if name.startswith("fills"):
            while not any(run.parent.glob("late*")):
                time.sleep(0.02)
            with suppress(OSError), (run / "filling").open("wb", buffering=0) as file:
                while file.write(bytes(2**16)):
                    pass
            while not tried.exists():
                time.sleep(0.02)
        else:
            while os.statvfs(run).f_bavail:
                time.sleep(0.02)
            tried.touch()
    level = "doubtful" if name.startswith("doubtful") else "trusted"
    reasons = [{"type": "AxisUnsure", "level": level}] if level == "doubtful" else []
    part = {
        "name": "<b>door", "verdict": {"level": level, "probability": 0.9, "reasons": reasons},
        "joint": {"type": "revolute", "axis": [0, 0, 1], "pivot": [0, 0, 0], "lower": 0, "upper": 1.5},
        "motion": {"intervals": [[1, 2]]},
    }  # fmt: skip
    (run / "twin").mkdir(exist_ok=True)
    twin = {"name": name, "verdict": {"level": level, "reasons": reasons}, "parts": [part]}
    (run / "twin" / "twin.json").write_text(json.dumps(twin))
    (run / "stages").mkdir(exist_ok=True)
    sys.stdout.write(json.dumps({"ok": level == "trusted"}))
    sys.exit(2 if level == "doubtful" else 0)
elif verb == "evaluate":
    row = {"metric": "axis", "part": "true door", "value": 0.5}
    sys.stdout.write(json.dumps({"rows": [row], "matched": {"true door": "<b>door"}}))
