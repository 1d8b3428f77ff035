"""Who works on a unit: a file that only one can make, and a pulse that tells that its maker lives.

Two batches on one folder, on one machine or on several that share a file system, so take different units.
Ages are told by the file system's own clock, which all of them see.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
from contextlib import suppress
from pathlib import Path

from twin.files.text import read_json

# s between two signs of life, and after which a claim without one is dead. Chosen by us: a network file
# system may show a file's time some seconds late.
PULSE, DEAD = 10.0, 60.0


class Claims:
    """The claims of one batch in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.host = folder / "claims", socket.gethostname()
        self.me = f"{self.host}-{os.getpid()}-{secrets.token_hex(4)}"
        self.folder.mkdir(parents=True, exist_ok=True)

    def take(self, unit: str) -> bool:
        """Claim a unit; False if somebody who lives has it. A dead claim is taken over.

        Raises OSError where no claim can be written, as on a full disk.
        """
        path = self._path(unit)
        if self._made(path):
            return True
        seen, age = read_json(path).get("by"), self._age(path)
        if age is not None and age < DEAD and not self._left_behind(path):
            return False
        moved = self.folder / f".{unit}.{self.me}.dead"
        with suppress(OSError):  # of those who see it dead one can move it away
            path.rename(moved)
            slow = read_json(moved).get("by") != seen  # another one took it over before: it gets it back
            if slow:
                path.hardlink_to(moved)
            moved.unlink()
            if slow:
                return False
        return self._made(path)

    def pulse(self, unit: str) -> bool:
        """Tell that this batch still works on a unit; False if somebody took it over meanwhile."""
        path = self._path(unit)
        if not self._mine(path):
            return False
        with suppress(OSError):
            os.utime(path)
        return True

    def release(self, unit: str) -> None:
        """Give a unit back."""
        path = self._path(unit)
        if self._mine(path):
            path.unlink(missing_ok=True)

    def _path(self, unit: str) -> Path:
        return self.folder / f"{unit}.claim"

    def _made(self, path: Path) -> bool:
        """Whether the file could be made: written aside and linked, so that it is never seen half."""
        aside = self.folder / f".{self.me}.new"
        told = json.dumps({"by": self.me, "host": self.host, "pid": os.getpid()})
        try:
            aside.write_text(told, encoding="utf-8")
            path.hardlink_to(aside)
        except FileExistsError:
            return False
        finally:
            aside.unlink(missing_ok=True)
        return True

    def _age(self, path: Path) -> float | None:
        """s since the last sign of life, by the clock that stamps files here; None if it is gone."""
        now = self.folder / f".{self.me}.now"
        now.touch()
        try:
            return now.stat().st_mtime - path.stat().st_mtime
        except FileNotFoundError:
            return None
        finally:
            now.unlink(missing_ok=True)

    def _left_behind(self, path: Path) -> bool:
        """Whether its maker was a process of this machine that is gone."""
        told = read_json(path)
        pid = told.get("pid")
        return told.get("host") == self.host and isinstance(pid, int) and not Path(f"/proc/{pid}").exists()

    def _mine(self, path: Path) -> bool:
        return read_json(path).get("by") == self.me
