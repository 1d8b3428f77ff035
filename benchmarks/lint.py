"""Which planted faults do public validators notice, and which does `twin lint`?

    python benchmarks/lint.py > benchmarks/lint.md

Plants every fault of benchmarks/lint_faults/ into an export of the closed-form cabinet and asks: yourdfpy,
Pinocchio and MuJoCo about URDF, MuJoCo about MJCF; OpenUSD's validators, NVIDIA's rules, SimReady's profile
and MuJoCo about USD (twin.validators). A program notices a fault when it refuses the file or says what it
does not say about the file without the fault. Needs the environment `validators` (twin engines --install
validators); takes some ten minutes on two cores.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
JUDGES = {
    "urdf": ("yourdfpy", "pinocchio", "mujoco"),
    "mjcf": ("mujoco",),
    "usd": ("openusd", "nvidia", "simready", "mujoco"),
}
TITLES = {
    "yourdfpy": "yourdfpy", "pinocchio": "Pinocchio", "mujoco": "MuJoCo", "openusd": "OpenUSD", "nvidia": "NVIDIA",
    "simready": "SimReady",
}  # fmt: skip


def load(judge: str, path: str) -> None:
    """Load a file as a user would; raises, crashes or prints where the program minds."""
    if judge == "yourdfpy":
        robot = import_module("yourdfpy").URDF.load(path, load_collision_meshes=True)
        if not robot.validate():
            raise ValueError(robot.errors)
    elif judge == "pinocchio":
        import_module("pinocchio").buildModelsFromUrdf(path, str(Path(path).parent))
    else:
        import_module("mujoco").MjSpec.from_file(path).compile()


def load_all(judge: str, *paths: str) -> None:
    """Load every file in a process of its own (a fork: imports take longer than loading); prints JSON path ->
    what it said."""
    import_module("mujoco._usd" if paths[0].endswith(".usda") else judge)
    said: dict[str, list[str]] = {}
    for path in paths:
        with tempfile.TemporaryFile() as sink:
            child = os.fork()
            if child == 0:
                os.dup2(sink.fileno(), 1)
                os.dup2(sink.fileno(), 2)
                try:
                    load(judge, path)
                except BaseException as e:
                    os.write(1, f"\n{type(e).__name__}: {e}".encode())
                    os._exit(1)
                os._exit(0)
            status = os.waitpid(child, 0)[1]
            sink.seek(0)
            lines = [x.strip() for x in sink.read().decode("utf-8", "replace").splitlines() if x.strip()]
        if status:
            said[path] = [f"refuses: {lines[-1] if lines else status}"]
        else:
            said[path] = [f"warns: {x}" for x in lines]
    print(json.dumps(said))


def loaders(judge: str, paths: Sequence[Path]) -> dict[Path, set[str]]:
    """What a program says when it loads the files."""
    command = [sys.executable, __file__, judge, *map(str, paths)]
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    told = json.loads(done.stdout.splitlines()[-1])
    return {p: set(told[str(p)]) for p in paths}


def rules(paths: Sequence[Path]) -> dict[str, dict[Path, set[str]]]:
    """What OpenUSD's validators and NVIDIA's rules find."""
    from twin.engines import interpreter
    from twin.validators import check_rules

    said: dict[str, dict[Path, set[str]]] = {v: {p: set() for p in paths} for v in ("openusd", "nvidia")}
    names = {str(p.resolve()): p for p in paths}
    for path in paths:
        for f in check_rules([path], interpreter("validators")):
            if kind := {"error": "refuses", "warning": "warns"}.get(f.severity):
                said[f.validator][names[str(path.resolve())]].add(f"{kind}: {f.rule} {f.message} {f.where}")
    return said


def profile(assets: Sequence[Path]) -> dict[Path, set[str]]:
    """Unmet requirements of SimReady's profile for props."""
    from twin.engines import interpreter
    from twin.validators import PROFILE

    with tempfile.TemporaryDirectory() as folder:
        listed, answer = Path(folder) / "assets.txt", Path(folder) / "answer.json"
        listed.write_text("".join(f"{p.resolve()}\n" for p in assets))
        command = [
            str(interpreter("validators").with_name("simready-validate")), "--profile", PROFILE[0], "--version", PROFILE[1],
            "--asset_list", str(listed), "--output", str(answer),
        ]  # fmt: skip
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)
        verdicts = json.loads(answer.read_text(encoding="utf-8"))
    said: dict[Path, set[str]] = {}
    for p in assets:
        features = verdicts[str(p.resolve())]["features_summary"]
        said[p] = {
            f"{'refuses' if told['blocking_failure'] else 'warns'}: {name} {told.get('failing requirements')} "
            f"{told.get('optional requirements')}"
            for name, told in features.items()
            if not told["passed"]
        }
    return said


def judged(fmt: str, paths: Sequence[Path]) -> dict[str, dict[Path, set[str]]]:
    """Program -> file -> what it says about it, and about the asset that a stage shows; messages without the
    file's folder."""
    said: dict[str, dict[Path, set[str]]] = {}
    assets = {p: asset(p) for p in paths}
    if fmt == "usd":
        verdicts = profile(list(assets.values()))
        found = rules(list(dict.fromkeys([*paths, *assets.values()])))
        said = {v: {p: told[p] | told[a] for p, a in assets.items()} for v, told in found.items()}
        said["simready"] = {p: verdicts[a] for p, a in assets.items()}
    for judge in JUDGES[fmt]:
        if judge not in said:
            told = loaders(judge, list(dict.fromkeys([*paths, *assets.values()])))
            said[judge] = {p: told[p] | told[a] for p, a in assets.items()}
    return {
        judge: {
            p: {x.replace(str(assets[p].parent), ".").replace(str(p.parent), ".") for x in texts}
            for p, texts in told.items()
        }
        for judge, told in said.items()
    }


def asset(path: Path) -> Path:
    """The USD asset that an exported stage shows with a runtime chosen; other files themselves."""
    from twin.validators import stages

    return stages(path)[-1] if path.suffix == ".usda" else path


def cell(new: set[str]) -> str:
    return "refuses" if any(x.startswith("refuses") for x in new) else "warns" if new else "–"


def table(fmt: str, rows: Sequence[tuple[Any, dict[str, set[str]]]]) -> list[str]:
    """One Markdown table and what was said."""
    judges = JUDGES[fmt]
    found = {j: sum(bool(new[j]) for _, new in rows) for j in judges}
    lines = [f"## {fmt.upper() if fmt != 'usd' else 'USD'}: {len(rows)} faults", ""]
    caught = sum(new["lint"] == {m.rule} for m, new in rows)
    lines += [f"twin lint {caught}, " + ", ".join(f"{TITLES[j]} {n}" for j, n in found.items()) + f" of {len(rows)}; "
              f"{sum(not any(new[j] for j in judges) for _, new in rows)} are noticed by twin lint alone.", ""]  # fmt: skip
    lines += [
        "| rule | fault | twin lint | " + " | ".join(TITLES[j] for j in judges) + " |",
        "|---" * (3 + len(judges)) + "|",
    ]
    for m, new in rows:
        own = "found" if new["lint"] == {m.rule} else "MISSED"
        lines.append(f"| {m.rule} | {m.name} | {own} | " + " | ".join(cell(new[j]) for j in judges) + " |")
    return [*lines, ""]


def planted(mutation: Any, source: Path, folder: Path) -> Path:
    """A copy of an export with one fault."""
    home = folder / mutation.id / "model" / source.parent.name
    shutil.copytree(source.parent, home)
    path = home / source.name
    try:  # into the asset itself, which the profile judges
        mutation.plant(asset(path))
    except AssertionError:  # what only a runtime knows is written in the stage that chooses it
        mutation.plant(path)
    return path


def own(path: Path) -> set[tuple[str, str]]:
    """What twin lint finds in a file and in the asset that it shows: rules, and where."""
    from twin.lint import lint

    return {(f.rule, f.element) for f in lint(list(dict.fromkeys([path, asset(path)]))).findings}


def main() -> None:
    from benchmarks.lint_faults import MUTATIONS, lint_twin
    from twin.exporters import export
    from twin.lint import lint

    lines: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = dict(export(lint_twin(), folder / "clean"))
        clean = lint(list(files.values())).findings
        known = {
            fmt: own(path) for fmt, path in files.items()
        }  # the bare asset has no friction: its parts may drift
        for fmt in JUDGES:
            mine = [m for m in MUTATIONS if m.format == fmt]
            paths = [planted(m, files[fmt], folder) for m in mine]
            with ThreadPoolExecutor(max_workers=2) as pool:
                found = list(pool.map(own, paths))
            said = judged(fmt, [files[fmt], *paths])
            rows = [
                (
                    m,
                    {"lint": {rule for rule, _ in o - known[fmt]}}
                    | {j: told[p] - told[files[fmt]] for j, told in said.items()},
                )
                for m, p, o in zip(mine, paths, found, strict=True)
            ]
            lines += table(fmt, rows)
            print(fmt, "done", file=sys.stderr)
    print(
        "# Faults that public validators don't notice\n\n"
        "Made by `python benchmarks/lint.py`: every fault of `benchmarks/lint_faults/` planted, one at a time, into an export of\n"
        "the closed-form cabinet, in which twin lint finds "
        + (f"{len(clean)} faults" if clean else "nothing")
        + ". *refuses*: the program does not load the file or reports an error; *warns*: it\n"
        "says something that it does not say about the file without the fault; –: it notices nothing. MuJoCo is asked to compile the file.\n"
        "What a program minds need not be the fault itself: SimReady refuses the block in a drawer's way because it has no material.\n"
    )
    print("\n".join(lines).rstrip())


if __name__ == "__main__":
    main() if len(sys.argv) == 1 else load_all(*sys.argv[1:])
