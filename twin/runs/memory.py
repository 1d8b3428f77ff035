"""Peak memory of this process."""

from __future__ import annotations

import ctypes
import re
import resource
from contextlib import suppress
from pathlib import Path


def peak_memory_mb() -> float:
    """Largest resident memory of this process in MB since the last reset, else since its start."""
    with suppress(OSError, ValueError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        match = re.search(r"VmHWM:\s+(\d+) kB", status)
        if match:
            return int(match[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def reset_peak_memory() -> None:
    """Count the peak from now on, without what the allocator keeps of earlier work."""
    with suppress(OSError, AttributeError):  # glibc only
        ctypes.CDLL(None).malloc_trim(0)
    with suppress(OSError):  # Linux only; elsewhere the peak is that of the whole process
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
