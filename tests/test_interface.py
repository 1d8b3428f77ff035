"""Python as people write it: names that show, paths as texts, and values that show themselves in a line."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
import typing
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
import robots
import twin
from benchmarks.scenes.boards import cabinet_twin, opening_motion
from robots import formats
from robots.formats import native
from robots.simulation.report import ReplayReport
from tests.laws import assert_for_all
from tests.makers.robots import planned_motions
from twin.lint import lint
from twin.page import render
from twin.physics import with_physics
from twin.scene import JointSigma, Part, Twin
from twin.storage import save

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("twin", "robots", "recon")


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_shows_the_names_that_it_loads_when_they_are_used(package: str) -> None:
    module = import_module(package)
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        assert getattr(module, name) is not None


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checkers_see_every_public_name(package: str) -> None:
    """Each is imported by name in the package's own text; none is left to a function that a type checker
    can't run."""
    tree = ast.parse((ROOT / package / "__init__.py").read_text(encoding="utf-8"))
    bound = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    bound |= {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    assert set(import_module(package).__all__) <= bound


def test_a_misspelled_name_is_an_error_to_type_checkers() -> None:
    """A module-level __getattr__ that they see makes every name valid."""
    for package in PACKAGES:
        tree = ast.parse((ROOT / package / "__init__.py").read_text(encoding="utf-8"))
        assert "__getattr__" not in {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}


@pytest.mark.slow
def test_mypy_knows_the_names_and_refuses_misspelled_ones(tmp_path: Path) -> None:
    used = tmp_path / "used.py"
    used.write_text(
        "import recon, robots, twin\n"
        "made = twin.from_urdf('a.urdf')\n"
        "reveal_type(made)\n"
        "reveal_type(robots.plan(made, 'door'))\n"
        "twin.export(made, 'out')\n"
        "twin.lod('run')\n"
        "robots.pln(made)\n"
        "recon.reconstrct(made)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file=", "--ignore-missing-imports", str(used)],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    said = [line for line in done.stdout.splitlines() if line.startswith(str(used)) or "used.py" in line]
    assert [line.split(": ", 1)[1] for line in said if "reveal" not in line] == [
        'note: Revealed type is "twin.scene.Twin"',
        'note: Revealed type is "robots.trajectory.RobotTrajectory"',
        'error: Module has no attribute "lod"; maybe "load"?  [attr-defined]',
        'error: Module has no attribute "pln"; maybe "plan"?  [attr-defined]',
        'error: Module has no attribute "reconstrct"; maybe "reconstruct"?  [attr-defined]',
    ]


def public_functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Functions of the packages' __all__, and of the rooms that documents name."""
    for package in (*PACKAGES, "robots.formats", "twin.report", "twin.lint"):
        module = import_module(package)
        for name in getattr(module, "__all__", ["lint"]):
            found = getattr(module, name)
            if inspect.isfunction(found):
                yield f"{package}.{name}", found


def parts_of(annotation: Any) -> list[Any]:
    """All types in a union, a sequence or a mapping."""
    inner = annotation if isinstance(annotation, list) else typing.get_args(annotation)
    return [annotation, *(kind for a in inner for kind in parts_of(a))]


def test_every_path_argument_of_a_public_function_takes_a_text() -> None:
    seen, refused = 0, []
    for name, function in public_functions():
        hints = typing.get_type_hints(function)
        for argument, annotation in hints.items():
            kinds = parts_of(annotation)
            takes_path = any(inspect.isclass(k) and issubclass(k, Path) for k in kinds) or any(
                "PathLike" in str(k) for k in kinds
            )
            if argument != "return" and takes_path:
                seen += 1
                refused += [] if str in kinds else [f"{name}({argument})"]
    assert refused == []
    assert seen >= 12


def test_one_name_stands_for_a_list_of_one(tmp_path: Path) -> None:
    """A text is a sequence of letters: `formats="csv"` was refused for "c"."""
    source = planned_motions.door()
    assert list(formats.export_trajectory(source, "csv", tmp_path / "csv")) == ["csv"]
    save(cabinet_twin(), tmp_path / "twin")
    with pytest.raises(twin.InputError, match="format 'mjfc' is not known"):
        twin.export(cabinet_twin(), tmp_path, "mjfc")
    with pytest.raises(twin.InputError, match="rule 'mass' is not known"):
        lint(str(tmp_path), "mass")
    with pytest.raises(twin.InputError, match="engine 'mujco' is not known"):
        twin.check(with_physics(cabinet_twin()), {"mjcf": tmp_path / "twin/twin.json"}, "mujco")


def test_paths_as_texts_do_what_paths_do(tmp_path: Path) -> None:
    made, run = cabinet_twin(), str(tmp_path / "run")
    twin.save(made, f"{run}/twin")
    assert twin.load(run).name == made.name
    files = twin.export(made, f"{run}/export", formats="mjcf", cache_dir=f"{run}/stages/collision")
    assert files["mjcf"].is_file()
    assert twin.check(made, {"mjcf": str(files["mjcf"])}, engines="mujoco").rows
    with pytest.warns(UserWarning, match="armature"):
        assert [p.name for p in twin.from_mjcf(str(files["mjcf"]), exclude="drawer").parts] == ["door"]
    assert render(run) == Path(run) / "report.html"
    with pytest.raises(twin.InputError, match="can't be read"):
        native.load(f"{run}/trajectory.json")
    assert robots.resolve(str(ROOT / "assets" / "robots" / "franka.toml")).name == "franka"
    with pytest.raises(twin.InputError, match="no trajectory format"):
        formats.export_trajectory(None, ["nothing"], f"{run}/out")  # type: ignore[arg-type]


def with_sigma(made: Twin) -> Twin:
    door = made.parts[0]
    joint = replace(door.joint, sigma=JointSigma(np.deg2rad(0.25), 0.004, np.deg2rad(1.0)))
    return replace(made, parts=(replace(door, joint=joint), *made.parts[1:]))


def test_a_twin_shows_itself_in_a_line_and_not_in_a_quarter_of_a_million_characters() -> None:
    text = repr(with_sigma(cabinet_twin(nested=True)))
    assert len(text) < 400
    assert "\n" not in text
    for word in ("cabinet", "carcass", "door", "drawer", "revolute", "80.2°", "0.300 m", "± 0.25°", "faces"):
        assert word in text
    many = cabinet_twin()
    many = replace(many, parts=tuple(replace(many.parts[0], id=k, name=f"door_{k}") for k in range(2, 250)))
    assert len(repr(many)) < 600
    assert "242 more" in repr(many)


def scene_values() -> list[Any]:
    made = with_sigma(cabinet_twin(nested=True))
    part = made.parts[0]
    motion = opening_motion(1.0)
    nothing = replace(motion, frames=[], times=[], state=[], intervals=())
    inner = [
        part,
        part.mesh,
        part.joint,
        part.motion,
        nothing,
        part.contact,
        part.collision[0],
        part.inertial,
    ]
    return [made, made.static, *inner, part.physics, made.cameras, made.recorded, *made.parts]


def results() -> list[Any]:
    """What robots and fits return, each with arrays in it."""
    told = {"robot": "franka", "part": "door", "ok": True, "faults": (), "reached": 1.0, "slip_mm": 0.3}
    report = ReplayReport(**dict.fromkeys(ReplayReport.__dataclass_fields__) | told)  # type: ignore[arg-type]
    seen = np.linspace(0, 1, 40)[:, None, None] * [0.3, 0, 0] + np.random.default_rng(0).uniform(
        0, 1, (1, 30, 3)
    )
    return [planned_motions.door().trajectory, report, recon.fit_motion(seen)]


def shows_itself_in_a_line(value: Any) -> None:
    text = repr(value)
    assert type(value).__name__ in text
    assert len(text) < 300
    assert "\n" not in text
    assert "array(" not in text


@pytest.mark.parametrize("values", [scene_values, results])
def test_every_type_shows_itself_in_a_line(values: Callable[[], list[Any]]) -> None:
    assert_for_all(shows_itself_in_a_line, values())


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert not attrs
        self.open.append(tag)
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("whole", [True, False])
def test_notebooks_show_a_table_with_every_part(whole: bool) -> None:
    made = with_sigma(cabinet_twin(nested=True))
    shown: Twin | Part = made if whole else made.parts[-1]
    text = shown._repr_html_()
    tags = _Tags()
    tags.feed(text)
    assert tags.open == []
    assert set(tags.seen) <= {"table", "caption", "thead", "tbody", "tr", "th", "td"}
    assert tags.seen.count("tr") == 1 + (len(made.parts) if whole else 1)
    assert "flap" in text


def test_what_a_user_wrote_is_escaped_in_the_table() -> None:
    """Names are legal, so no sign of HTML passes; a law of types that changes must not open the table."""
    made = cabinet_twin()
    object.__setattr__(made, "name", "<script>&")
    assert "<script>" not in made._repr_html_()
    assert "&lt;script&gt;&amp;" in made._repr_html_()
