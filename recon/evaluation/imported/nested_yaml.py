"""Names within names of a YAML file, in some data sets' plain block form: `key:`, deeper, `key: word`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from recon.readers.files import read_bytes, shown
from twin.errors import InputError

MAX_BYTES = 2**20  # chosen by us
_LINE = re.compile(
    r"""(?P<indent> *)(?P<key>"[^"]*"|'[^']*'|[^\s\-\[\]{}&*!|>%@`,#"'][^:#]*?) *:(?: +(?P<value>.*))?"""
)
_COMMENT = re.compile(r"(^|\s)#.*")
_FLOW = "[{&*!|>%@`"


def nested_mapping(path: Path, top: str) -> dict[str, Any]:
    """What stands under one key of a file, as names to words or to further names.

    Other keys of the file may hold anything. Raises InputError that names the line which is of another form.
    """
    data = read_bytes(path)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = "\0"
    if len(data) > MAX_BYTES or "\0" in text:
        raise InputError(f"{shown(path)} is no YAML text of at most {MAX_BYTES} bytes", "copy it again")
    found: dict[str, Any] = {}
    open_: list[
        tuple[int, dict[str, Any]]
    ] = []  # mappings that the next line may belong to, with their own indent
    inside = False
    for k, line in enumerate(text.splitlines(), 1):
        plain = _COMMENT.sub("", line).rstrip()
        if not plain:
            continue
        if not plain.startswith((" ", "\t")):
            inside = plain == f"{top}:"
            open_ = [(0, found)]
        elif inside:
            _add(open_, plain, f"{shown(path)} line {k}")
    if not found:
        raise InputError(f"{shown(path)} holds nothing under {top}", "copy it again")
    return found


def _add(open_: list[tuple[int, dict[str, Any]]], line: str, where: str) -> None:
    """Put a line into the mapping that its indent belongs to, and open another one when it has no word."""
    match = _LINE.fullmatch(line)
    value = (match["value"] or "").strip() if match else ""
    if match is None or value.startswith(tuple(_FLOW)):
        raise InputError(f"{where} is {line.strip()[:60]!r}", "write it as `name: word`, indented by blanks")
    indent = len(match["indent"])
    while open_[-1][0] >= indent:
        open_.pop()
    _, mapping = open_[-1]
    key = match["key"].strip("\"'")
    if value:
        mapping[key] = value.strip("\"'")
    else:
        mapping[key] = {}
        open_.append((indent, mapping[key]))
