"""XML of unknown origin: no document types, no entities, nothing fetched."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree as ET
from xml.parsers import expat

from twin.errors import InputError

_MOST = 256 * 2**20  # bytes; the largest public robot description is a thousandth of it


def read_xml(path: Path) -> tuple[ET.Element, dict[ET.Element, int]]:
    """The root element, and the line of every element.

    Raises InputError when the file can't be read, is not well-formed or declares a document type (through
    which entities can name other files or grow without bound).
    """
    try:
        if path.stat().st_size > _MOST:
            raise InputError(f"{path} has {path.stat().st_size} bytes", "it is too large for a description")
        data = path.read_bytes()
    except OSError as e:
        raise InputError(f"{path} can't be read: {e.strerror or e}", "check the path") from e
    lines: dict[ET.Element, int] = {}
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    def refuse(*_: object) -> NoReturn:
        raise InputError(
            f"{path} declares a document type (line {parser.CurrentLineNumber})",
            "remove the DOCTYPE and its entities: files of unknown origin are read without them",
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as e:  # the latter two for unknown encodings
        raise InputError(f"{path} is not well-formed XML: {e}", "open it in an XML editor") from e
    return builder.close(), lines
