"""The URDF folder as a ROS package, so that package:// paths resolve."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

from twin.errors import InputError
from twin.exporters.asset import AssetInfo
from twin.exporters.mjcf import write_xml
from twin.exporters.urdf import MESHES

_NAME = re.compile(r"[a-z][a-z0-9_]*[a-z0-9]")  # REP 144


def check_package(name: str) -> None:
    """Raises InputError unless `name` may name a ROS package (REP 144)."""
    if not _NAME.fullmatch(name) or "__" in name:
        raise InputError(
            f"{name!r} can't name a ROS package",
            "use two or more lower-case letters, digits and single underscores, starting with a letter",
        )


def write_package(folder: Path, urdf: str, name: str, asset: AssetInfo) -> None:
    """Turn the folder of a written URDF into the ROS 2 package `name`.

    Adds package.xml, CMakeLists.txt and urdf/<urdf>, a copy of the file `urdf` with its mesh paths as
    package://<name>/... It resolves, built or in a workspace; the file without package:// stays.
    """
    text = (folder / urdf).read_text(encoding="utf-8")
    (folder / "urdf").mkdir()
    resolved = text.replace(f'filename="{MESHES}', f'filename="package://{name}/{MESHES}')
    (folder / "urdf" / urdf).write_text(resolved, encoding="utf-8", newline="\n")
    write_xml(_manifest(name, urdf, asset), folder / "package.xml")
    lines = [
        "cmake_minimum_required(VERSION 3.8)",
        f"project({name})",
        "find_package(ament_cmake REQUIRED)",
        "install(DIRECTORY meshes urdf DESTINATION share/${PROJECT_NAME})",
        "ament_package()",
    ]
    (folder / "CMakeLists.txt").write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _manifest(name: str, urdf: str, asset: AssetInfo) -> ET.Element:
    root = ET.Element("package", format="3")
    ET.SubElement(root, "name").text = name
    ET.SubElement(root, "version").text = "0.0.0"
    ET.SubElement(root, "description").text = f"Functional digital twin {Path(urdf).stem} as URDF"
    ET.SubElement(root, "maintainer", email="todo@todo.todo").text = asset.author
    ET.SubElement(root, "license").text = asset.license
    ET.SubElement(root, "buildtool_depend").text = "ament_cmake"
    ET.SubElement(ET.SubElement(root, "export"), "build_type").text = "ament_cmake"
    return root
