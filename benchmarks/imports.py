"""Other people's articulated files through the verbs, every result judged by hand: `imports.md`.

    python -m benchmarks.imports [FOLDER ...]               # the files that have no row yet, then the page
    python -m benchmarks.imports --only TEXT [FOLDER ...]   # the files whose name holds TEXT, no page
    python -m benchmarks.imports --sheets [FOLDER ...]      # also pictures of source and export to judge by

benchmarks/imports.toml names the collections: Python packages, whose files belong to third parties and are
not in this repository. FOLDER holds them, unpacked by `pip install --no-deps --target FOLDER NAME==VERSION
...`; without one, installed packages are taken. A file is taken when it lies where its collection keeps
objects and has a hinge or a slide, includes read. Robots are left out.

Each file goes through import, lint, export, lint of the export, check and replay with default options, as a
user types them. Rows are kept in out/imports, one file a commit, so that a stopped run goes on; a commit that
leaves the program alone needs no new rows. imports.toml holds the judgement on each result; a result that
differs from the one that was judged is "to be judged" on the page.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import distributions
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from benchmarks import sealing
from benchmarks.imports_page import page
from twin.errors import FuntwinError, InputError
from twin.files.text import write_text
from twin.lint.xml import read_xml
from twin.page.facts import part_facts
from twin.storage import load

HERE = Path(__file__).resolve().parent
LIST, PAGE, OUT = HERE / "imports.toml", HERE / "imports.md", sealing.ROOT / "out" / "imports"
# What makes the rows.
MEASURES = ("twin", "robots", "recon", "assets", "benchmarks/imports.py")
# For all verbs on one file. Chosen by us: five times what the slowest file takes.
MINUTES = 10


def listed() -> dict[str, Any]:
    """Collections and judgements of imports.toml."""
    return tomllib.loads(LIST.read_text(encoding="utf-8"))


def measured_commit() -> str:
    """The last commit that changed what makes the rows. Raises InputError for changes in no commit."""
    if sealing.git("status", "--porcelain", "--", *MEASURES):
        raise InputError("the program has changes that are in no commit", "commit them: rows are of a commit")
    return sealing.git("log", "-1", "--format=%h", "--abbrev=10", "--", *MEASURES)


def found(folders: Sequence[Path]) -> dict[str, Path]:
    """Name -> articulated file of every collection. Raises InputError for a package that is not there."""
    places = {"path": [str(f) for f in folders]} if folders else {}
    there = {d.metadata["Name"].lower().replace("_", "-"): d for d in distributions(**places)}
    files = {}
    for told in listed()["collection"].values():
        for package in told["packages"]:
            version = there[package].version if package in there else "none"
            if version != told["version"]:
                raise InputError(
                    f"{package} {told['version']} is needed, and {version} is there",
                    f"pip install --no-deps --target FOLDER {package}=={told['version']}, then name FOLDER",
                )
        root = Path(str(there[told["packages"][0]].locate_file("")))
        kept = [f for f in root.glob(told["objects"]) if f.name not in told["robots"] and moves(f)]
        files |= {f.relative_to(root).as_posix(): f for f in sorted(kept)}
    return files


def moves(path: Path) -> bool:
    """Whether a URDF or MJCF file has a hinge or a slide, in itself or in what it includes."""
    kinds = {"revolute", "continuous", "prismatic", "hinge", "slide"}
    root = read_xml(path)[0]
    if root.tag not in ("robot", "mujoco"):
        return False
    return any(j.get("type", "hinge") in kinds for j in _joints(root, path.parent))


def _joints(element: ET.Element, folder: Path) -> Iterator[ET.Element]:
    """Joints of bodies; those of defaults, actuators and sensors describe or name others."""
    for child in element:
        if child.tag == "joint":
            yield child
        elif child.tag == "include" and (folder / child.get("file", "")).is_file():
            yield from _joints(read_xml(folder / child.get("file", ""))[0], folder)
        elif child.tag in ("worldbody", "body", "frame"):
            yield from _joints(child, folder)


def measured(file: Path, run: Path) -> dict[str, str]:
    """Step -> what the verb says of a file. After an import that fails only lint is asked."""
    words: dict[str, tuple[object, ...]] = {
        "import": ("import", file, "-o", run), "lint": ("lint", file), "export": ("export", run),
        "lint of the export": ("lint", run), "check": ("check", run), "replay": ("replay", run),
    }  # fmt: skip
    told: dict[str, str] = {}
    end = time.monotonic() + 60 * MINUTES
    for step, command in words.items():
        if step != "lint" and not (run / "twin" / "twin.json").is_file() and told:
            continue
        try:
            done = subprocess.run(
                [sys.executable, "-m", "twin", *map(str, command), "--json"], cwd=sealing.ROOT, capture_output=True,
                text=True, timeout=max(end - time.monotonic(), 1), env=sealing.environment(sealing.ROOT), check=False,
            )  # fmt: skip
            line = said(step, done.returncode, done.stdout, done.stderr, run)
        except subprocess.TimeoutExpired:
            line = f"not done in {MINUTES} minutes"
        told[step] = line.replace(f"{run}/", "").replace(f"{file.parent}/", "")
    return told


def said(step: str, code: int, out: str, err: str, run: Path) -> str:
    """What a verb says, in one line: exit code, then what a judge must know; two digits of measured
    numbers."""
    try:
        data = json.loads(out)
    except ValueError:
        return f"{code}: {(err.strip().splitlines() or ['nothing'])[-1]}"
    if "error" in data:
        return f"{code}: {data['error']}; {data['remedy']}"
    lines: list[str] = []
    if step == "import":
        lines = [*_parts(run), *(f"warns: {w}" for w in data["warnings"])]
    elif step.startswith("lint"):
        counts = Counter(f"{f['severity']} {f['rule']}" for f in data["findings"])
        lines = [f"{what} x {n}" if n > 1 else what for what, n in sorted(counts.items())]
    elif step == "export":  # what a format can't carry is the same for every file
        lines = [_short(w) for w in data["warnings"] if "not carried" not in w or "must not collide" in w]
    elif step == "check":
        rows = [r for proof in ("agreement", "behaviour") for r in data[proof]["rows"] if not r["ok"]]
        lines = sorted({f"{r.get('field', r.get('quantity'))} of {r['part']}" for r in rows})
    elif step == "replay":
        lines = [f"{n}: {'opened' if p['ok'] else _short(p['reason'])}" for n, p in data["parts"].items()]
    return f"{code}: {'; '.join(lines) or 'nothing to say'}"


def _parts(run: Path) -> Iterator[str]:
    """Joint, range and closed end of every part of a run's twin, as its page shows them."""
    twin = load(run)
    for part in twin.parts:
        facts = {name: value for name, value, _ in part_facts(part)}
        on = "" if part.parent is None else f" on {twin.part(part.parent).name}"
        yield f"{part.name}{on}: {part.joint.kind}, {facts['range']}, closed at {part.closed_source}"


def _short(text: str) -> str:
    """A text whose decimal numbers have two digits: more of them differ between machines."""
    return re.sub(r"\d+\.\d+(?:e[+-]?\d+)?", lambda m: f"{float(m[0]):.2g}", text)


def rows(files: Mapping[str, Path], state: Path, sheets: bool) -> list[dict[str, Any]]:
    """A row for every file: those kept in `state`, and the others measured and kept."""
    state.parent.mkdir(parents=True, exist_ok=True)
    kept = state.read_text(encoding="utf-8").splitlines() if state.is_file() else []
    done = {row["name"]: row for row in map(json.loads, kept)}
    for name, file in files.items():
        run = state.with_suffix("") / name
        if name not in done:
            digest, started = hashlib.sha256(file.read_bytes()).hexdigest()[:12], time.monotonic()
            shutil.rmtree(run, ignore_errors=True)  # of a run that was stopped
            steps = measured(file, run)
            done[name] = {
                "name": name,
                "digest": digest,
                "seconds": round(time.monotonic() - started),
                "steps": steps,
            }
            with state.open("a", encoding="utf-8") as out:
                out.write(json.dumps(done[name], ensure_ascii=False) + "\n")
            print(f"{len(done)}: {name}, {done[name]['seconds']} s", flush=True)
        if sheets:
            from benchmarks.imports_sheet import sheet

            sheet(file, run, state.with_suffix("") / f"{name.replace('/', '_')}.png")
    return [done[name] for name in files]


def main() -> int:
    """Measure, write the page; 0 when every result is right or refused for its true reason, 2 otherwise."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", metavar="FOLDER", nargs="*", type=Path)
    parser.add_argument("--only", metavar="TEXT", default="")
    parser.add_argument("--sheets", action="store_true")
    args = parser.parse_args()
    try:
        commit = measured_commit()
        files = {name: file for name, file in found(args.folders).items() if args.only in name}
        done = rows(files, OUT / f"{commit}.jsonl", args.sheets)
    except FuntwinError as error:
        print(error, file=sys.stderr)
        return 1
    text, whole = page(done, listed(), commit)
    if not args.only:
        write_text(PAGE, text)
    return 0 if whole else 2


if __name__ == "__main__":
    sys.exit(main())
