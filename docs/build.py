"""The docs site: pages of the repository as they lie, and a reference from the docstrings. `make docs` runs
it, with the extra `docs`.

Sources are read, not imported (griffe). A link or an anchor that leads nowhere, a page that is missing, a
docstring that names a parameter which the function has not: each fails the build.

    python docs/build.py [FOLDER]          # out/docs by default
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import griffe
import yaml
from links import broken

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("twin", "recon", "robots")
GUIDE = (
    "first_twin",
    "commands",
    "limits",
    "results",
    "concepts",
    "recordings",
    "device_record3d",
    "device_stray_scanner",
    "device_azure_kinect",
    "device_realsense",
    "device_ros",
    "calibrating",
    "inspecting",
    "settings",
    "method",
    "metrics",
    "twin_format",
    "verdicts",
    "editing",
    "annotating",
    "fleets",
    "robots",
    "physics",
    "importing",
    "python",
    "architecture",
)
PROJECT = ("CHANGELOG.md", "CONTRIBUTING.md", "THIRD_PARTY.md")
HOME = "index.md"  # README.md under the name that a site's first page has

DOCSTRINGS: dict[str, Any] = {"returns_multiple_items": False, "returns_named_value": False}

Nav = list[dict[str, "str | Nav"]]


def title(page: Path) -> str:
    """First heading of a page."""
    found = re.search(r"^# (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise SystemExit(f"{page} has no heading of the first level")
    return found[1].replace("`", "")


def pages() -> dict[str, list[str]]:
    """Paths in the repository by section; a page of docs/ that GUIDE does not name comes last."""
    others = sorted(p.stem for p in (ROOT / "docs").glob("*.md") if p.stem not in GUIDE)
    return {
        "Guide": [f"docs/{name}.md" for name in (*GUIDE, *others)],
        "Benchmarks": [f"benchmarks/{p.name}" for p in sorted((ROOT / "benchmarks").glob("*.md"))],
        "Project": list(PROJECT),
    }


def linked_files(names: Sequence[str]) -> set[str]:
    """Files of the repository that pages show or link to, other pages left out."""
    found = set()
    for page in (ROOT / name for name in names):
        for link in re.findall(r"\]\(([^)\s#]+)\)", page.read_text(encoding="utf-8")):
            to = (page.parent / link).resolve()
            if to.is_file() and to.suffix != ".md":
                found.add(to.relative_to(ROOT).as_posix())
    return found


def stage(source: Path) -> Nav:
    """Copy the pages and what they show into `source`, laid out as in the repository; return the
    navigation."""
    nav: Nav = [{"Home": HOME}]
    for section, names in pages().items():
        nav.append({section: [{title(ROOT / n): n} for n in names]})
    taken = ["README.md", *(name for names in pages().values() for name in names)]
    for name in (*taken, *linked_files(taken)):
        to = source / (HOME if name == "README.md" else name)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, to)
    return nav


def rooms(package: griffe.Module) -> Iterator[tuple[str, list[griffe.Module]]]:
    """(path, modules) of a package's folders, a folder's folders with it; first the modules that lie in
    none."""

    def below(module: griffe.Module) -> Iterator[griffe.Module]:
        yield module
        for inner in module.modules.values():
            if not inner.is_alias:
                yield from below(inner)

    own = [m for m in package.modules.values() if not m.is_alias and m.name != "__main__"]
    yield package.path, [m for m in own if not m.is_init_module]
    for folder in (m for m in own if m.is_init_module):
        yield folder.path, list(below(folder))


def first_line(thing: griffe.Object | griffe.Alias) -> str:
    """What a docstring says first, fit for a cell of a table."""
    said = thing.docstring.value.split("\n\n")[0] if thing.docstring else ""
    return " ".join(said.split()).replace("|", "\\|")


def public(package: griffe.Module) -> str:
    """The page of what a package offers by its own name."""
    rows = {}
    for name in package.exports or ():
        thing = package[str(name)]
        where = thing.target_path if thing.is_alias else thing.path
        rows[str(name)] = f"| [`{package.path}.{name}`][{where}] | {first_line(thing)} |"
    listed = "\n".join(["| name | |", "|---|---|", *(rows[name] for name in sorted(rows))])
    return f"# {package.path}\n\n{first_line(package)}\n\n{listed}\n"


def reference(source: Path, loaded: griffe.GriffeLoader) -> Nav:
    """Write a page for each package and each of its folders; return their navigation."""
    (source / "reference").mkdir()
    nav: Nav = []
    for name in PACKAGES:
        package = loaded.modules_collection[name]
        (source / f"reference/{name}.md").write_text(public(package), encoding="utf-8")
        entries: Nav = [{f"{name}: public names": f"reference/{name}.md"}]
        for path, modules in rooms(package):
            page = f"reference/{path}.md" if path != name else f"reference/{name}.modules.md"
            heading = path if path != name else f"{name}: modules outside folders"
            body = "".join(f"\n::: {m.path}\n" for m in modules)
            (source / page).write_text(f"# {heading}\n{body}", encoding="utf-8")
            entries.append({path if path != name else "modules": page})
        nav.append({name: entries})
    return nav


class _Complaints(logging.Handler):
    """Keeps what griffe warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


def complaints(loaded: griffe.GriffeLoader) -> list[str]:
    """What is wrong with the docstrings: sections that can't be read, parameters that are not there, names
    that lead nowhere."""
    heard = _Complaints()
    logging.getLogger("griffe").addHandler(heard)

    def walk(thing: griffe.Object) -> Iterator[griffe.Object]:
        yield thing
        for inner in thing.members.values():
            if not inner.is_alias:
                yield from walk(inner)

    for name in PACKAGES:
        for thing in walk(loaded.modules_collection[name]):
            if thing.docstring is None:
                continue
            thing.docstring.parse("google", **DOCSTRINGS)
            for path in re.findall(
                rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)(?<!\.json)(?:\(.*?\))?`", thing.docstring.value
            ):
                if not known(loaded, path):
                    heard.texts.append(
                        f"{thing.filepath}: `{path}` in the docstring of {thing.path} does not exist"
                    )
    return [t.replace(f"{ROOT}/", "") for t in heard.texts]


def known(loaded: griffe.GriffeLoader, path: str) -> bool:
    """Whether a dotted path names a module or a member of one."""
    try:
        loaded.modules_collection[path]
    except (KeyError, griffe.AliasResolutionError):
        return False
    return True


def run_builder(work: Path, nav: Nav) -> bool:
    """Build `work`/pages into `work`/site; whether the builder found nothing to warn of."""
    config = yaml.safe_load((ROOT / "docs/mkdocs.yml").read_text(encoding="utf-8"))
    (handler,) = (p["mkdocstrings"]["handlers"]["python"] for p in config["plugins"] if "mkdocstrings" in p)
    handler |= {"paths": [str(ROOT)]}
    handler["options"]["docstring_options"] = DOCSTRINGS
    config |= {"docs_dir": "pages", "site_dir": "site", "nav": nav}
    (work / "mkdocs.yml").write_text(
        yaml.safe_dump(config, sort_keys=False, allow_unicode=True), encoding="utf-8"
    )
    command = [sys.executable, "-m", "zensical", "build", "--strict", "-f", str(work / "mkdocs.yml")]
    return subprocess.run(command, env=os.environ | {"NO_COLOR": "1"}).returncode == 0


def build(site: Path) -> list[str]:
    """Build the site, in place of an earlier one; return what is wrong with it."""
    loaded = griffe.GriffeLoader(search_paths=[ROOT], allow_inspection=False)
    for name in PACKAGES:
        loaded.load(name)
    wrong = complaints(loaded)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        nav = [*stage(work / "pages"), {"Reference": reference(work / "pages", loaded)}]
        if not run_builder(work, nav):
            return [*wrong, "zensical build --strict found what stands above"]
        shutil.rmtree(site, ignore_errors=True)
        shutil.move(work / "site", site)
    return [*wrong, *broken(site)]


if __name__ == "__main__":
    place = Path(*sys.argv[1:2] or [ROOT / "out/docs"]).resolve()
    if found := build(place):
        raise SystemExit("\n".join(found))
    print(f"{place}/index.html")
