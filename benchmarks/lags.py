"""Whether a lag of depth is named where there is one, and nowhere else: `lags.md`.

    python -m benchmarks.lags planted RECORDING...    # lags of 1, 2, 3, -1 frames put on recordings
    python -m benchmarks.lags open FIRST LAST         # random recordings without lag, open seeds 0 to 9999

A planted lag gives each colour picture the depth of an earlier frame. Random recordings are rendered small
and with one sample a pixel, looked at and deleted one by one; a delay below a frame, which is one of the
faults of hard pictures, is printed beside.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.sealing import OPEN_SEEDS
from recon.inspection import motion_checks
from recon.inspection.findings import late_frames, value
from recon.inspection.glance import glance
from recon.readers import open_recording
from recon.recording import Recording
from recon.simulate import simulate_random
from twin.cause import Cause
from twin.errors import FuntwinError, InputError
from twin.files.text import read_json

PLANTED = (1, 2, 3, -1)
SMALL = {"width": 320, "height": 240, "samples": 1, "ambient_samples": 1}


def told(recording: Recording) -> tuple[int | None, str]:
    """Whole frames of lag that are named, 0 for none and None where it is not known, and what is said."""
    (found,) = motion_checks.lag(glance(recording), recording) or (None,)
    if found is None:
        return 0, "none"
    return (late_frames(found), value(found)) if isinstance(found, Cause) else (None, "not known")


def planted(folders: list[Path]) -> int:
    """A line for each recording and lag; how many are named wrong."""
    wrong = 0
    for folder in folders:
        whole = open_recording(folder)
        for lag in (0, *PLANTED):
            frames, said = told(whole.without_depth_delay(-lag))
            wrong += frames not in (lag, None)
            print(f"| {folder.name} | {lag} | {said} |", flush=True)
    return wrong


def without(first: int, last: int) -> int:
    """A line for each seed; how many have a lag of whole frames by what is said."""
    if not 0 <= first <= last < OPEN_SEEDS:
        raise InputError(f"seeds {first} to {last} are not open", f"take some from 0 to {OPEN_SEEDS - 1}")
    wrong = 0
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory(prefix="lags") as place:
            folder = simulate_random(seed, Path(place) / "clip", settings=SMALL)
            delay = read_json(folder / "truth" / "random.json")["settings"]["picture"]["colour_delay_s"]
            frames, said = told(open_recording(folder))
        wrong += frames not in (0, None)
        print(f"| {seed} | {1000 * delay:.0f} ms | {said} |", flush=True)
    return wrong


def main() -> int:
    """Parse the command line; 0 when nothing is named wrong, else 2."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    on = verbs.add_parser("planted")
    on.add_argument("recordings", type=Path, nargs="+")
    free = verbs.add_parser("open")
    free.add_argument("first", type=int)
    free.add_argument("last", type=int)
    args = parser.parse_args()
    try:
        wrong = planted(args.recordings) if args.verb == "planted" else without(args.first, args.last)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{wrong} named wrong")
    return 2 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
