"""Which planted faults do public validators notice, and which does `twin lint`?

    python benchmarks/lint.py > benchmarks/lint.md

Plants every fault of tests/twin/lint_mutations.py into an export of the closed-form cabinet and asks: yourdfpy, Pinocchio and MuJoCo about
URDF, MuJoCo about MJCF; OpenUSD's validators, NVIDIA's rules, SimReady's profile and MuJoCo about USD (twin.validators). A program
notices a fault when it refuses the file or says what it does not say about the file without the fault. Needs the environment
`validators` (twin engines --install validators); takes some ten minutes on two cores.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
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
        import yourdfpy

        robot = yourdfpy.URDF.load(path, load_collision_meshes=True)
        if not robot.validate():
            raise ValueError(robot.errors)
    elif judge == "pinocchio":
        import pinocchio

        pinocchio.buildModelsFromUrdf(path, str(Path(path).parent))
    else:
        if path.endswith(".usda"):
            from importlib import import_module

            import_module("mujoco._usd")
        import mujoco

        mujoco.MjSpec.from_file(path).compile()


def loader(judge: str, path: Path) -> set[str]:
    """What a program says when it loads a file; "refuses" when it does not load it."""
    done = subprocess.run(
        [sys.executable, __file__, judge, str(path)],
        cwd=path.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [x.strip() for x in (done.stdout + done.stderr).splitlines() if x.strip()]
    if done.returncode:
        return {f"refuses: {lines[-1] if lines else done.returncode}"}
    return {f"warns: {x}" for x in lines if not x.startswith("MUJOCO_LOG")}


def validated(path: Path) -> dict[str, set[str]]:
    """What the USD validators find; their messages without the folder."""
    from twin.validators import validate_usd

    said: dict[str, set[str]] = {"openusd": set(), "nvidia": set(), "simready": set()}
    for f in validate_usd(path).findings:
        kind = {"error": "refuses", "warning": "warns"}.get(f.severity)
        if kind:
            said[f.validator].add(f"{kind}: {f.rule} {f.message} {f.where}".replace(str(path.parent), "."))
    return said


def judged(fmt: str, path: Path) -> dict[str, set[str]]:
    """Program -> what it says about a file; "twin lint" -> rules."""
    from twin.lint import lint

    said = validated(path) if fmt == "usd" else {}
    said |= {j: loader(j, path) for j in JUDGES[fmt] if j not in said}
    return said | {"lint": {f.rule for f in lint([path]).findings}}


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


def main() -> None:
    from tests.twin.lint_mutations import MUTATIONS, lint_twin
    from twin.export import export
    from twin.validators import stages

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = dict(export(lint_twin(), folder / "clean"))
        homes = {f: p.parent for f, p in files.items()}
        clean = {f: judged(f, p) for f, p in files.items()}
        clean = {
            f: {j: {x.replace(str(homes[f]), ".") for x in s} for j, s in said.items()}
            for f, said in clean.items()
        }

        def plant(m: Any) -> dict[str, set[str]]:
            home = folder / m.id / "model" / homes[m.format].name
            shutil.copytree(homes[m.format], home)
            path = home / files[m.format].name
            try:  # into the asset itself, which the profile judges
                m.plant(stages(path)[-1] if m.format == "usd" else path)
            except AssertionError:  # what only a runtime knows is written in the stage that chooses it
                m.plant(path)
            said = judged(m.format, path)
            return {j: {x.replace(str(home), ".") for x in said[j]} - clean[m.format][j] for j in said}

        with ThreadPoolExecutor(max_workers=2) as pool:
            found = list(pool.map(plant, MUTATIONS))
    lines = [
        "# Faults that public validators don't notice", "",
        "Made by `python benchmarks/lint.py`: every fault of `tests/twin/lint_mutations.py` planted, one at a time, into an export of the",
        "closed-form cabinet. *refuses*: the program does not load the file, or reports an error; *warns*: it says something that it does",
        "not say about the file without the fault; –: it notices nothing. The export itself: "
        + "; ".join(f"{f} " + ("no finding" if not clean[f]["lint"] else "FINDINGS") for f in clean) + " of twin lint.", "",
    ]  # fmt: skip
    for fmt in JUDGES:
        lines += table(fmt, [(m, new) for m, new in zip(MUTATIONS, found, strict=True) if m.format == fmt])
    print("\n".join(lines))


if __name__ == "__main__":
    main() if len(sys.argv) == 1 else load(*sys.argv[1:])
