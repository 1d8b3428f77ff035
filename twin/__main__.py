"""The command `twin`, also `python -m twin`: hears Ctrl-C before the imports that take time."""

from __future__ import annotations

import os
from typing import NoReturn

from twin import interrupt

# OpenBLAS would start threads of its own, which wait by spinning and take the cores from ours; our systems
# are small. It reads this once, when NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main() -> NoReturn:
    """Entry point of the command."""
    interrupt.handle()
    try:
        from twin.cli import main as cli

        cli.main()
    except BaseException as e:
        # before the command line caught errors, or after: some imports turn an interruption into an error
        if interrupt.happened() and not isinstance(e, SystemExit):
            interrupt.leave(tell=True)
        raise


if __name__ == "__main__":
    main()
