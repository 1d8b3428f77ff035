"""What can be told without a heavy import is told before one: a wrong name costs a moment, a wrong folder no
reconstruction."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from recon.pipeline import reconstruct
from recon.recording import Intrinsics, Recording
from tests.forked import Forked, Server
from twin.errors import InputError
from twin.files.paths import require_writable

ROOT = Path(__file__).resolve().parents[1]
RECORDING = str(ROOT / "assets" / "recordings" / "cabinet_drawer")
CHEST = str(ROOT / "assets" / "scenes" / "chest.xml")
# Importing any of these takes longer than reading a twin; NumPy, which the scene types need, is not among
# them.
HEAVY = ("mujoco", "open3d", "scipy", "cv2", "mink", "pinocchio", "matplotlib", "numba", "av", "trimesh", "pxr", "sklearn")  # fmt: skip
CODE = (
    "import json, sys; from pathlib import Path; from twin.cli import main as cli; code = cli.run(json.loads(sys.argv[1])); "
    "heavy = {m.split('.')[0] for m in sys.modules} & set(json.loads(sys.argv[2])); "
    "Path(sys.argv[3]).write_text(json.dumps([code, sorted(heavy)]))"
)
# What every command may import, and some here do; were one of them heavy, each test would tell.
LIGHT = ("numpy", "recon.readers", "recon.verbs", "robots.replay_verb", "twin.exporters", "twin.importers")
Told = Callable[..., str]


PAGE = "<title>run · Funtwin</title>"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with a twin, and a page and a manifest as a reconstruction leaves them."""
    folder = tmp_path_factory.mktemp("run")
    twin.save(cabinet_twin(), folder / "twin")
    (folder / "manifest.json").write_text('{"format": "funtwin-run/1", "stages": []}')
    (folder / "report.html").write_text(PAGE)
    return folder


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose twin/ is somebody else's."""
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "twin").mkdir()
    (folder / "twin" / "notes.txt").write_text("mine")
    return folder


@pytest.fixture(scope="module")
def command_line() -> Iterator[Server]:
    server = Server(LIGHT)
    yield server
    server.close()


@pytest.fixture
def told_early(command_line: Server, tmp_path_factory: pytest.TempPathFactory) -> Told:
    """Gives the line on standard error; the command must end with code 1 and nothing heavy imported but what
    is `needed`."""

    def told(argv: Sequence[str], needed: Sequence[str] = ()) -> str:
        folder = tmp_path_factory.mktemp("told")
        said, answer = folder / "said.txt", folder / "answer.json"
        words = [sys.executable, "-c", CODE, json.dumps(list(argv)), json.dumps(HEAVY), str(answer)]
        Forked(command_line, words, cwd=str(ROOT), stdout=str(said), env=os.environ).wait(60)
        code, imported = json.loads(answer.read_text())
        assert (code, sorted(set(imported) - set(needed))) == (1, []), said.read_text()
        assert said.read_text().count("\n") == 1
        return said.read_text()

    return told


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("replay RUN --robot frnka", "no robot 'frnka'; known robots: franka, spot; did you mean 'franka'?"),
        ("replay RUN --part dor", "no part 'dor'; did you mean 'door'?"),
        ("replay RUN --part door --goal ajar", "goal 'ajar' of part 'door'"),
        ("replay RUN --goal 1.5", "goal '1.5' of part 'door'"),
        ("replay RUN --control soft", "control = 'soft' must be one of 'position', 'impedance'"),
        ("trajectory RUN --robot frnka --format csv -o OUT", "no robot 'frnka'"),
        ("trajectory RUN --part dor --format csv -o OUT", "no part 'dor'"),
        ("physics set RUN --part dor --mass 2", "no part 'dor'"),
        ("import no.urdf -o OUT", "no.urdf is no file"),
        (f"import {CHEST} -o RUN", "holds a twin already"),
        (f"demo --robot frnka --recording {RECORDING} -o OUT", "no robot 'frnka'"),
        ("evaluate RUN --truth WRONG", "WRONG holds no truth.json"),
        ("simulate no.xml --joint lid -o OUT", "no scene file no.xml"),
        ("simulate --random 1 --walk 2 -o OUT", "--random and --walk draw different recordings"),
        ("simulate --random 1 --seconds 20 -o OUT", "--seconds 20 is the length of a walk"),
        ("simulate --walk 1 --joint lid -o OUT", "--walk draws a scene of its own"),
        ("reconstruct NO_SUCH_RECORDING -o OUT", "recording NO_SUCH_RECORDING does not exist"),
        ("demo --recording NO_SUCH_RECORDING -o OUT", "recording NO_SUCH_RECORDING does not exist"),
        ("inspect NO_SUCH_RECORDING", "recording NO_SUCH_RECORDING does not exist"),
        ("inspect CLIP", "is a ZED recording, which is not read"),
        ("reconstruct CLIP -o OUT", "is a ZED recording, which is not read"),
        (f"reconstruct {RECORDING} -o OUT --layout nope", "no recording layout 'nope'"),
        (f"reconstruct {RECORDING} -o OUT --config no.toml", "no.toml does not exist"),
        ("export RUN --asset wrong", "--asset 'wrong' is not KEY=VALUE"),
        ("export RUN --package Wrong", "'Wrong' can't name a ROS package"),
        ("lint nofile", "nofile does not exist"),
        ("physics set RUN --part door --material nope", "material 'nope' is not in the table"),
    ],
)
def test_a_wrong_name_is_told_before_heavy_imports(
    options: str, words: str, run: Path, tmp_path: Path, told_early: Told
) -> None:
    (tmp_path / "x.svo2").write_bytes(b"\x89MCAP0\r\n")
    places = {"RUN": str(run), "OUT": str(tmp_path / "out"), "CLIP": str(tmp_path / "x.svo2")}
    assert words in told_early([places.get(word, word) for word in options.split()])
    assert not (tmp_path / "out").exists()
    assert (run / "report.html").read_text() == PAGE


def test_a_joint_that_a_scene_lacks_is_told_by_mujoco_alone(tmp_path: Path, told_early: Told) -> None:
    line = told_early(
        ["simulate", CHEST, "--joint", "ld", "-o", str(tmp_path / "out")], needed=("mujoco", "pxr")
    )
    assert "no hinge or slide joint 'ld'; did you mean 'lid'?" in line
    assert not (tmp_path / "out").exists()


OUTPUTS = (
    f"demo --recording {RECORDING} -o OUT",
    f"reconstruct {RECORDING} -o OUT",
    f"simulate {CHEST} --joint lid -o OUT",
    f"import {CHEST} -o OUT",
    "trajectory RUN --format csv -o OUT",
)


@pytest.mark.parametrize("options", OUTPUTS, ids=lambda o: o.split()[0])
def test_an_output_that_is_a_file_is_told_before_heavy_imports(
    options: str, run: Path, tmp_path: Path, told_early: Told
) -> None:
    out = tmp_path / "out"
    out.write_text("a file")
    places = {"RUN": str(run), "OUT": str(out)}
    assert "can't be written: Not a directory" in told_early([places.get(w, w) for w in options.split()])
    assert out.read_text() == "a file"


@pytest.mark.parametrize("options", [o for o in OUTPUTS if o.split()[0] in ("demo", "reconstruct", "import")])
def test_a_foreign_twin_folder_is_told_before_anything_is_computed(
    options: str, foreign: Path, told_early: Told
) -> None:
    line = told_early([str(foreign) if word == "OUT" else word for word in options.split()])
    assert f"{foreign / 'twin'} exists and does not hold a twin" in line
    assert sorted(p.name for p in foreign.rglob("*")) == ["notes.txt", "twin"]


def test_reconstruct_refuses_a_foreign_twin_folder_before_it_reads_a_frame(foreign: Path) -> None:
    def read(index: int) -> NoReturn:
        raise AssertionError(f"frame {index} was read")

    recording = Recording(
        "r", "r", np.arange(60) / 15.0, Intrinsics(8, 6, 8.0, 8.0, 4.0, 3.0), read, read, "0" * 16
    )
    with pytest.raises(InputError, match="does not hold a twin"):
        reconstruct(recording, out=foreign)
    assert sorted(p.name for p in foreign.rglob("*")) == ["notes.txt", "twin"]


def test_a_folder_is_tried_and_left_as_it_was(tmp_path: Path) -> None:
    require_writable(tmp_path / "a" / "b")
    require_writable(tmp_path)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="can't be written"):
        require_writable(Path("/proc/nowhere/out"))
