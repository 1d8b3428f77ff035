"""Errors that teach: what was wrong, the value, what to try.

Every error that a user can cause derives from `FuntwinError`. The command line prints its message as one line
and exits with code 1; anything else is a bug and keeps its traceback.
"""

from __future__ import annotations

import re

_ERRNO = re.compile(r"\[(?:Errno|WinError) -?\d+\] ")


def plain(problem: object) -> str:
    """The text without the number that a system error's text begins with, which means nothing to a user."""
    return _ERRNO.sub("", str(problem))


class FuntwinError(Exception):
    """Base of all expected errors.

    Args:
        problem: what was wrong, naming the file or field and the value.
        remedy: what to try.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        self.problem = problem = plain(problem)
        self.remedy = remedy
        super().__init__(f"{problem}; {remedy}" if remedy else problem)


class InputError(FuntwinError):
    """A file, a folder or an argument that the user gave can't be used."""


class SceneError(FuntwinError):
    """A scene value breaks a law of its type (unit axis, positive mass, tree, unique names, ...)."""


class ReconstructionError(FuntwinError):
    """The recording is readable but does not hold what a stage needs (nothing moves, too few tracks, ...)."""


class MissingDependencyError(FuntwinError):
    """An optional package or a system library is absent; the message names what to install."""


class PlanningError(FuntwinError):
    """No robot motion satisfies the request; the message says where and by how much it fails."""


class ConfigError(FuntwinError):
    """A configuration key or value is not known or not allowed."""


class ServiceError(FuntwinError):
    """A service on the network, which the user asked for, gave no usable answer; the message holds no key."""


# Share of common letters, chosen by us: at 0.5 "bogus" is taken for "robots", at 0.7 "tun" isn't for "tum".
_ALIKE = 0.6


def nearest_name(name: str, names: list[str], alike: float = _ALIKE) -> str:
    """Return the known name most like `name`, or an empty string when none is close."""
    from difflib import get_close_matches

    close = get_close_matches(name, names, n=1, cutoff=alike)
    return close[0] if close else ""
