"""Files that a description names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath

from twin.lint.meshes import is_absolute
from twin.lint.model import Fault, LintModel


def absolute(model: LintModel) -> Iterator[Fault]:
    for r in model.references:
        if is_absolute(r.written):
            yield Fault(
                "error",
                r.element,
                r.written,
                "an absolute path",
                "write it relative to the file that names it",
            )


def missing(model: LintModel) -> Iterator[Fault]:
    for r in model.references:
        if (
            r.path is not None
            and not is_absolute(r.written)
            and not r.path.is_file()
            and "[" not in r.written
        ):
            yield Fault(
                "error",
                r.element,
                r.written,
                "there is no such file",
                "put the file there, or correct the path",
            )


def outside(model: LintModel) -> Iterator[Fault]:
    """One fault for each folder or address."""
    folder = model.path.resolve().parent
    told: dict[str, list[str]] = {}
    for r in model.references:
        if is_absolute(r.written):
            continue
        if r.path is None:
            told.setdefault("/".join(r.written.split("/")[:3]), []).append(r.element)
        elif "://" not in r.written and not r.path.resolve().is_relative_to(folder):
            told.setdefault(str(PurePosixPath(r.written.replace("\\", "/")).parent), []).append(r.element)
    for where, elements in told.items():
        more = f" and {len(elements) - 1} more" if len(elements) > 1 else ""
        yield Fault(
            "warning",
            elements[0] + more,
            where,
            "files outside of the description's own folder",
            "copy them beside it",
        )
