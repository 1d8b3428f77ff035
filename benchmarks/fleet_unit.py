"""Stands in for the program `twin` in benchmarks/fleet.py: a unit that sleeps and holds memory.

    python benchmarks/fleet_unit.py SECONDS MB VERB RECORDING -o RUN --json

It writes a twin that its name alone decides, and beside it the CPU seconds that it took itself.
"""

import json
import sys
import time
from pathlib import Path

seconds, memory_mb, run = float(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[sys.argv.index("-o") + 1])
end = time.monotonic() + seconds
held = bytearray(b"x" * 1_000_000) * memory_mb
(run / "twin").mkdir(parents=True, exist_ok=True)
joint = {"type": "revolute", "axis": [0, 0, 1], "pivot": [0, 0, 0], "lower": 0, "upper": 1.5}
part = {"name": "door", "verdict": {"level": "trusted", "reasons": []}, "joint": joint}
twin = {"name": run.name, "verdict": {"level": "trusted", "reasons": []}, "parts": [part]}
time.sleep(max(0.0, end - time.monotonic()))
(run / "twin" / "twin.json").write_text(json.dumps(twin))
(run / "cpu.json").write_text(json.dumps({"seconds": time.process_time(), "held": len(held)}))
sys.stdout.write('{"ok": true}')
