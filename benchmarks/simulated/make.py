"""Render the simulated benchmark recordings of specs.toml.

    python benchmarks/simulated/make.py OUT [NAME ...]

writes OUT/<name>/ for all or the named recordings; those that are already complete are left alone.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from recon.simulate import SimulateConfig, simulate
from twin.errors import FuntwinError, InputError

HERE = Path(__file__).parent
SCENES = HERE.parents[1] / "assets" / "scenes"


def read_specs() -> dict[str, dict[str, Any]]:
    """The specs by name, in the order of the file."""
    specs = tomllib.loads((HERE / "specs.toml").read_text())["recording"]
    return {spec["name"]: spec for spec in specs}


def make(spec: dict[str, Any], out: Path) -> bool:
    """Render one recording to `out`; False when it was there already."""
    if (out / "truth" / "truth.json").is_file():
        return False
    partial = out.with_name(out.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    scene = spec["scene"] if spec["scene"] == "kitchen" else SCENES / spec["scene"]
    simulate(scene, spec["joint"], partial, SimulateConfig(**spec["config"]))
    partial.rename(out)
    return True


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the command line and render; 0 when all are there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", help="recordings of specs.toml; none means all")
    args = parser.parse_args(argv)
    specs = read_specs()
    try:
        unknown = sorted(set(args.names) - set(specs))
        if unknown:
            raise InputError(f"no recording named {unknown[0]!r}", f"there are: {', '.join(specs)}")
        args.out.mkdir(parents=True, exist_ok=True)
        for name in args.names or specs:
            start = time.perf_counter()
            done = "rendered" if make(specs[name], args.out / name) else "already there"
            print(f"{name}: {done}, {time.perf_counter() - start:.0f} s", flush=True)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
