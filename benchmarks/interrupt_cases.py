"""Run folders with files of a user's strewn everywhere, the command's verbs on them, and what must hold
whatever ended a verb."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET  # files that this project wrote
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

REPOSITORY = Path(__file__).resolve().parents[1]
RECORDING = REPOSITORY / "assets/recordings/cabinet_drawer"
SCENE = REPOSITORY / "assets/scenes/chest.xml"
STAGES = 9
# Where a user's files lie in a run folder: beside ours, below ours, hidden, and under names like ours.
STREWN = (
    "notes.txt", ".hidden", "my photos/a b.jpg", "twin/notes.md", "twin/photos/deep/a.jpg", "twin/.secret",
    "twin/meshes/mine.ply", "twin/labels/readme.txt", "export/notes.txt", "export/mjcf/my_scene.xml",
    "export/mjcf/assets/bolt.obj", "export/urdf/launch/view.py", "export/urdf/meshes/bolt.obj", "export/usd/mine.usda",
    "replay/notes.txt", "replay/franka/drawer/mine.csv", "replay/own/a/replay.txt", "report/mine.txt", "stages/mine.txt",
    "stages/collision/mine.txt",
)  # fmt: skip
TELLTALES = (
    "Traceback",
    "Exception ignored",
    "KeyboardInterrupt",
    "terminate called",
    "Fatal Python",
    "dumped",
)


@dataclass(frozen=True)
class Case:
    """A verb: its arguments in a place, how the place is made ready (returns the share of the verb's full
    work that is left), how often it is ended, which files say its result, whether it writes, and the words
    with which it refuses to be done twice."""

    verb: str
    arguments: tuple[str, ...]
    count: int = 5
    prepare: Callable[[Path, Random], float] = lambda _place, _rng: 1.0
    results: tuple[str, ...] = ()
    writes: bool = True
    once: str = ""


def stages_left(place: Path, rng: Random) -> float:
    """Leave the first k stages of the run, k any of 0..9; the twin goes where stages do. Returns the share of
    time that is left."""
    run = place / "run"
    keep = rng.randrange(STAGES + 1)
    seconds = [s["seconds"] for s in json.loads((run / "manifest.json").read_text())["stages"]]
    for stage in sorted((run / "stages").glob("[0-9][0-9]_*"))[keep:]:
        shutil.rmtree(stage)
    shutil.rmtree(
        run / "twin"
    )  # an exported or edited one stays as it is, and is not what the stages say: another case
    if keep == 0 and rng.random() < 0.5:
        shutil.rmtree(run)
    return 0.1 + 0.9 * sum(seconds[keep:]) / sum(seconds)


def shapes_left(place: Path, rng: Random) -> float:
    """Half of the time the twin lacks collision shapes, half of the time the run was not exported."""
    run = place / "run"
    if rng.random() < 0.5:
        document = json.loads((run / "twin/twin.json").read_text())
        document["parts"][0]["collision"] = []
        (run / "twin/twin.json").write_text(json.dumps(document, indent=1))
        shutil.rmtree(run / "stages/collision", ignore_errors=True)
    if rng.random() < 0.5:
        shutil.rmtree(run / "export")
    return 1.0


def other_replay(place: Path, rng: Random) -> float:
    """Half of the time there was a replay before, which says something else."""
    folder = place / "run/replay/franka/drawer"
    if rng.random() < 0.5:
        report = json.loads((folder / "report.json").read_text())
        (folder / "report.json").write_text(json.dumps(report | {"grasp": "an earlier one"}))
    else:
        for name in ("report.json", "trajectory.json", "trajectory.npz", "replay.mp4"):
            (folder / name).unlink()
    return 1.0


CASES = (
    Case("demo", ("-o", "run"), 4, stages_left, ("run/twin/meshes", "run/export", "run/replay")),
    Case(
        "simulate",
        (str(SCENE), "--joint", "lid", "-o", "out", "--set", "width=320", "--set", "height=240", "--set", "frames=40"),
        results=("out",),
        once="is not an empty folder",
    ),
    Case("reconstruct", (str(RECORDING), "-o", "run"), 15, stages_left, ("run/twin",)),
    Case("import", (str(SCENE), "-o", "new"), results=("new/twin",), once="holds a twin already"),
    Case("export", ("run", "--asset", "author=Me"), 15, shapes_left, ("run/export", "run/twin/meshes")),
    Case("check", ("run",)),
    Case("lint", ("run",), 4, writes=False),
    Case("replay", ("run",), 15, other_replay, ("run/replay",)),
    Case("trajectory", ("run", "--format", "json", "npz", "csv", "ros2", "moveit", "-o", "mine/out"), 7, results=("mine/out",)),
    Case("evaluate", ("run", "--truth", str(RECORDING / "truth")), 4),
    Case("physics", ("set", "run", "--mass", "3.5", "--note", "weighed"), 6, results=("run/twin",)),
    Case("doctor", (), 4, writes=False),
    Case("robots", ("list",), 6, writes=False),
    Case("engines", (), 6, writes=False),
)  # fmt: skip


def make_base(folder: Path) -> None:
    """A finished run, made by `twin demo` once, into `folder`/run."""
    if not (folder / "run/report.html").is_file():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "tmp").mkdir(exist_ok=True)
        done = start("demo", ("-o", "run"), folder)
        _, told = done.communicate()
        if done.returncode:
            raise RuntimeError(f"twin demo failed: {told}")


def make_place(base: Path, place: Path, case: Case, rng: Random) -> float:
    """A fresh copy of the run with a user's files and keys, made ready for the verb."""
    shutil.copytree(base / "run", place / "run")
    for folder in ("tmp", "mine/out"):
        (place / folder).mkdir(parents=True)
    share = case.prepare(place, rng)
    run = place / "run"
    for path in (*STREWN, "../mine/out/trajectory.txt", "../mine/out/csv/notes.txt", "../by the way.txt"):
        target = run / path
        if path.startswith("twin/") and not (run / "twin/twin.json").exists():
            continue  # a folder twin/ that holds no twin is refused, as it should be
        if path.startswith("../") or run.is_dir():
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(f"of the user: {path}".encode())
    if (run / "twin/twin.json").exists():
        document = json.loads((run / "twin/twin.json").read_text())
        for owner in (document, document["parts"][0], document["parts"][0]["joint"]):
            owner["x_mine"] = {"shelf": [1, 2.5, "drei"]}
        (run / "twin/twin.json").write_text(json.dumps(document, indent=1))
    return share


def start(
    verb: str, arguments: Sequence[str], place: Path, before: Callable[[], None] | None = None, **env: str
) -> subprocess.Popen[str]:
    """The verb as a process in a session of its own, in `place`, with temporary files in place/tmp."""
    return subprocess.Popen(
        [sys.executable, "-m", "twin", verb, *arguments],
        cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=before,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "TMPDIR": str(place / "tmp"), "OMP_NUM_THREADS": "1", **env},
    )  # fmt: skip


def state(place: Path) -> dict[str, str]:
    """SHA-256 of every file in a place, but for temporary ones."""
    return {
        p.relative_to(place).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(place.rglob("*"))
        if p.is_file() and not p.is_symlink() and p.relative_to(place).parts[0] != "tmp"
    }


def of_user(place: Path) -> dict[str, str]:
    """The user's files: path -> SHA-256."""
    return {
        path: value
        for path, value in state(place).items()
        if (place / path).read_bytes().startswith(b"of the user: ")
    }


def result(case: Case, place: Path) -> dict[str, str]:
    """What the verb's result is: the files that it made."""
    mine = of_user(place)
    return {
        path: value
        for path, value in state(place).items()
        if path not in mine and any(path.startswith(f"{r}/") for r in case.results)
    }


def harm(place: Path, before: Mapping[str, str], mine: Mapping[str, str]) -> list[str]:
    """What was lost or is torn: files of the user that changed, keys that are gone, files of ours that are
    neither as they were nor whole."""
    now, found = state(place), []
    for path, value in mine.items():
        if now.get(path) != value and not _kept_aside(path, value, now):
            found.append(f"lost {path}")
    file = place / "run/twin/twin.json"
    if "run/twin/twin.json" in before:
        text = file.read_text() if file.is_file() else ""
        if text.count("x_mine") != 3:
            found.append("lost keys of twin.json")
    for path, value in now.items():
        temporary = any(part.startswith(".") for part in Path(path).parts)
        if path not in mine and before.get(path) != value and not temporary:
            told = torn(place / path)
            if told:
                found.append(f"torn {path}: {told}")
    return found


def _kept_aside(path: str, value: str, now: Mapping[str, str]) -> bool:
    """Whether a file of the user lies in the copy of an earlier twin."""
    return path.startswith("run/twin/") and value in [
        v for p, v in now.items() if p.startswith("run/twin_before_")
    ]


def torn(path: Path) -> str:
    """Why a file is not whole; empty when it is."""
    try:
        _READERS.get(path.suffix, lambda _: None)(path)
    except Exception as e:
        return f"{type(e).__name__}: {e}".splitlines()[0]
    return ""


def leftovers(place: Path, mine: Mapping[str, str]) -> list[str]:
    """Temporary files and locks outside of the temporary folder."""
    names = [p.relative_to(place) for p in place.rglob(".*")]
    known = (".thumbs", ".hidden", ".secret")  # a folder of an exported asset, and the user's
    return [str(n) for n in names if n.name not in known and n.as_posix() not in mine and n.parts[0] != "tmp"]


def _json(path: Path) -> None:
    json.loads(path.read_text(encoding="utf-8"))


def _npz(path: Path) -> None:
    import numpy as np

    with np.load(path, allow_pickle=False) as data:
        for name in data:
            data[name]


def _ply(path: Path) -> None:
    from twin.files.ply import read_ply

    if "truth" in path.parts:
        import trimesh

        trimesh.load(path)
    else:
        read_ply(path)


def _picture(path: Path) -> None:
    data = path.read_bytes()
    end = b"IEND\xaeB`\x82" if path.suffix == ".png" else b"\xff\xd9"
    if not data.endswith(end):
        raise ValueError("ends too soon")


def _film(path: Path) -> None:
    import av

    with av.open(str(path)) as film:
        frames = sum(1 for _ in film.decode(video=0))
    if frames < 2:
        raise ValueError(f"{frames} frames")


def _xml(path: Path) -> None:
    root = ET.parse(path).getroot()  # noqa: S314
    if root.tag == "mujoco" and path.name != "my_scene.xml":
        import mujoco

        mujoco.MjModel.from_xml_path(str(path))
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if name and not name.startswith("package://") and not (path.parent / name).is_file():
            raise FileNotFoundError(name)


def _usd(path: Path) -> None:
    from pxr import Sdf

    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    if not (layer.rootPrims or layer.subLayerPaths):
        raise ValueError("holds nothing")


def _obj(path: Path) -> None:
    data = path.read_bytes()
    if not data.endswith(b"\n") or b"\nf " not in data:
        raise ValueError("ends too soon")


def _page(path: Path) -> None:
    if not path.read_text(encoding="utf-8").rstrip().endswith("</html>"):
        raise ValueError("ends too soon")


def _npy(path: Path) -> None:
    import numpy as np

    np.load(path, allow_pickle=False)


_READERS: dict[str, Callable[[Path], None]] = {
    ".json": _json, ".npz": _npz, ".npy": _npy, ".ply": _ply, ".png": _picture, ".jpg": _picture, ".mp4": _film, ".xml": _xml,
    ".urdf": _xml, ".usda": _usd, ".usdc": _usd, ".obj": _obj, ".html": _page,
}  # fmt: skip


def stage_seconds(run: Path) -> float:
    """How long the stages of a run took, all together."""
    return float(sum(s["seconds"] for s in json.loads((run / "manifest.json").read_text())["stages"]))
