"""Names Python packages to install, whatever installs them: pip, uv, pipx and conda each have a command."""

from __future__ import annotations

import re
import sys
from importlib import metadata


def to_install(package: str, extra: str = "") -> str:
    """The remedy for an absent package.

    Args:
        package: its name; the version that Funtwin wants is added where its metadata tells one.
        extra: the extra of Funtwin that it belongs to.
    """
    wanted = [r for r in requirements(extra) if normal(r) == normal(package)]
    of_extra = f" (Funtwin's extra `{extra}`)" if extra else ""
    return f"install the package {wanted[0] if wanted else package}{of_extra} into {environment()}"


def requirements(extra: str = "") -> list[str]:
    """What Funtwin requires, or what its extra does, as "name>=version"; empty if it is not installed."""
    try:
        listed = metadata.requires("funtwin") or []
    except metadata.PackageNotFoundError:
        return []
    found = []
    for text in listed:
        requirement, _, condition = text.partition(";")
        of = re.search(r"extra\s*==\s*[\"']([^\"']+)", condition)
        if (of[1] if of else "") == extra:
            found.append(requirement.strip())
    return found


def normal(requirement: str) -> str:
    """The package's name in a requirement, spelled as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=!~ ;]", requirement)[0]).lower()


def environment() -> str:
    """The environment that packages have to go to."""
    return f"the Python environment {sys.prefix}"
