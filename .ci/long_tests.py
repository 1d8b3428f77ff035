"""Write tests/long.txt from what `pytest -m 'not slow' --durations=0 -vv` printed: tests of a second or more.

    .venv/bin/python .ci/long_tests.py LOG [--add]

A test counts with its fixtures, and with its longest parameters.
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path

LIST = Path(__file__).resolve().parents[1] / "tests" / "long.txt"
_SECONDS = 1.0
_LINE = re.compile(r"\s*([\d.]+)s (?:call|setup|teardown)\s+(\S.*?)\s*")


def long_tests(log: str) -> list[str]:
    """Names (path::function) of the tests of a log that took long."""
    took: dict[str, float] = defaultdict(float)
    for line in log.splitlines():
        if found := _LINE.fullmatch(line):
            took[found[2]] += float(found[1])
    return sorted({name.partition("[")[0] for name, seconds in took.items() if seconds >= _SECONDS})


if __name__ == "__main__":
    log = Path(sys.argv[1]).read_text(encoding="utf-8")
    known = LIST.read_text(encoding="utf-8").split() if "--add" in sys.argv else []
    LIST.write_text("\n".join(sorted({*known, *long_tests(log)})) + "\n", encoding="utf-8")
