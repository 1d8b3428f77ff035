"""Every command and every Python snippet of README and docs/: it is read by the verb's own parser, its
settings exist, and it runs as it stands, in a folder that holds what its capital letters mean. What only
parses stands in a table with the reason."""

from __future__ import annotations

import ast
import itertools
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layouts.azure_kinect import write_azure_kinect
from benchmarks.layouts.boards import texture, write_boards
from benchmarks.layouts.phones import write_r3d, write_stray
from benchmarks.layouts.ros import write_ros2
from benchmarks.layouts.ros_realsense import write_realsense
from benchmarks.scenes.boards import cabinet_twin
from recon.config import ReconConfig
from recon.readers import open_recording
from recon.readers.calibration.file import Calibration
from recon.recording import Recording
from recon.recording.rig import Lens
from recon.recording.write import write_recording
from tests.makers.recon.phone_recording import phone_recording
from twin import verification
from twin.cli import given
from twin.cli import main as cli
from twin.cli.table import SETTINGS, named
from twin.errors import ConfigError
from twin.files.assets import asset
from twin.geometry import make_pose
from twin.page import page as report_page
from twin.runs.settings import to_toml
from twin.storage import save

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", *sorted(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md"))]
CONFIGS = {verb: named(home) for verb, home in SETTINGS.items()} | {"demo": ReconConfig}
FENCED = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r" *(?:twin|make|pip|python) ")

NETWORK, ENGINES = "asks a service on the network", "needs environments of about 3 GB, which it fetches"
ITSELF = "is run by .ci/run on every change, in other folders than a test's"
MINUTES = "takes minutes and recordings that are not in the repository"
BATCH = "takes minutes a recording; tests/twin/batch has its parts"
ONLY_PARSED = {
    "make demo": ITSELF,
    "make test": ITSELF,
    "make wheel": ITSELF,
    "pip install -e .": ITSELF,
    'pip install "$(ls dist/funtwin-*.whl)[record3d,ros]"': ITSELF,
    'pip install "$(ls dist/funtwin-*.whl)[record3d]"': ITSELF,
    "python .ci/constants.py": "prints counts of the source",
    "twin demo": ITSELF,
    "python .ci/settings_page.py": "writes docs/settings.md; tests/test_settings_law.py compares",
    "python -m benchmarks.complete RUN RECORDING/truth": "tests/benchmarks/test_complete.py has its parts",
    "python -m benchmarks.complete sealed": "takes an hour; tests/benchmarks/test_complete_sealed.py has its parts",
    "python -m benchmarks.unseen sealed": "takes two hours; tests/test_unseen.py has its parts",
    "python benchmarks/reconstruct.py RUNS RECORDING...": MINUTES,
    "twin check RUN --engines all": ENGINES,
    "twin check RUN --engines validators": ENGINES,
    "twin engines --install all": ENGINES,
    "twin physics estimate RUN": NETWORK,
    "twin reconstruct RECORDING -o RUN --type-hint vlm": NETWORK,
    "twin reconstruct WALK -o ROOM": "tests/test_walk.py renders a walk and reconstructs it",
    "twin annotate RECORDING -o RUN": "serves until somebody ends it; tests/recon/annotation has its parts",
    "twin evaluate RUN --truth RUN/truth": "needs what a person marked; tests/recon/annotation has its parts",
    "twin batch RECORDING... -o DIR": BATCH,
    "twin batch recordings/* random:0-9 -o out/batch --do reconstruct,evaluate,export --workers 4": BATCH,
    "twin batch recordings/* random:0-9 -o out/batch --retry failed": BATCH,
    "twin batch -o out/batch --page": BATCH,
    "twin batch @recordings.txt -o /shared/batch --shard $SLURM_ARRAY_TASK_ID/8 --workers 2 --memory 4": BATCH,
    "twin batch @recordings.txt -o /shared/batch --backend ray --address auto --memory 4": BATCH,
    "twin view RUN": "serves until somebody ends it; tests/twin/view has its parts",
    "twin robots fetch": "needs the name of a robot, which the text around it leaves out; fetches its model",
    "twin robots show": "needs the name of a robot, which the text around it leaves out",
}
RECONSTRUCTED = (
    "twin evaluate RUN --truth RECORDING/truth"  # runs after every reconstruction, in the slow test
)
INSPECTED = "twin inspect RECORDING"  # runs before every reconstruction
SNIPPETS_PARSED = {
    "bosdyn.client": "is for a program that talks to a Spot, with packages and a robot that a test has not",
}
# what stands before a page's snippets, and what of them is made smaller to be quick
BEFORE = {
    "docs/robots.md": "from pathlib import Path\nimport numpy as np\nimport twin as package\n"
    "twin = package.load('RUN')\nclass Recording(list):\n    def color(self, k): return self[k]\n"
    "recording = Recording([np.zeros((48, 64, 3), np.uint8)] * 60)\n",
}
FIRST = {
    "twin edit RUN --undo": "twin edit RUN --part NAME upper=31cm",
    "twin export out/chest": "twin import assets/scenes/chest.xml -o out/chest",
}  # as the page has it
SMALLER = {"trials=100": "trials=1", "--trials 100": "--trials 1"}
# the pages' word on a recording, as it is true of the shipped one
SAID = {
    "upper=92deg axis=vertical": "upper=31cm axis=front",
    "320,240@45": "200,175@45",
    "30:75": "30:64",
    "--type hinge": "--type slide",
}
LESS_WORK = {"twin simulate": "--set width=64 --set height=48 --set frames=60 --set samples=1"}


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and content of each fenced block."""
    return FENCED.findall((ROOT / page).read_text(encoding="utf-8"))


def commands(page: str) -> Iterator[str]:
    """Commands in blocks and in running text, comments cut off, `a|b` told apart. A verb's bare name is no
    command."""
    text = (ROOT / page).read_text(encoding="utf-8")
    lines = [line for _, block in blocks(page) for line in block.splitlines() if COMMAND.match(line)]
    named = [" ".join(c.split()) for c in re.findall(r"`([^`]+)`", FENCED.sub("", text)) if COMMAND.match(c)]
    whole = [
        c for c in named if c.split()[0] != "twin" or len(c.split()) > 2 or c.split()[1] not in cli.VERBS
    ]
    for line in [*lines, *whole]:
        words = re.sub(r"\s+#.*", "", line).strip()
        yield from (" ".join(w) for w in itertools.product(*(w.split("|") for w in words.split(" "))))


ALL = list(dict.fromkeys((page, c) for page in PAGES for c in commands(page)))
RUNNABLE = list(dict.fromkeys(c for _, c in ALL if c not in (*ONLY_PARSED, RECONSTRUCTED, INSPECTED)))
RECONSTRUCT = [c for c in RUNNABLE if c.startswith("twin reconstruct")]
SLOW = [c for c in RUNNABLE if c.startswith(("twin replay", "twin trajectory", "twin simulate"))]
CALIBRATE = [c for c in RUNNABLE if c.startswith("twin calibrate")]
QUICK = [c for c in RUNNABLE if c not in (*SLOW, *RECONSTRUCT, *CALIBRATE)]
# recordings of devices, by the names that their pages have for them
DEVICES: dict[str, Callable[[Recording, Path], object]] = {
    "clip.r3d": write_r3d,
    "STRAY": write_stray,
    "clip.mkv": write_azure_kinect,
    "clip.bag": lambda r, out: write_realsense(r, out, make_pose(translation=[-0.015, 0, 0])),
    "BAG": write_ros2,
}
SNIPPETS = [(page, code) for page in PAGES for language, code in blocks(page) if language == "python"]


def words_of(command: str) -> list[str]:
    """The arguments of `twin`, with a file for FILE."""
    for written, here in (SMALLER | SAID).items():
        command = command.replace(written, here)
    extra = next((shlex.split(x) for verb, x in LESS_WORK.items() if command.startswith(verb)), [])
    exported = "RUN/export/mjcf/cabinet.xml"
    return [exported if w in ("FILE", "FILE...") else w for w in shlex.split(command)[1:]] + extra


def dedented(code: str) -> str:
    margin = len(code) - len(code.lstrip(" "))
    return "".join(line[margin:] for line in code.splitlines(keepends=True))


@pytest.mark.parametrize(("page", "command"), ALL)
def test_every_command_of_the_documents_is_understood(page: str, command: str) -> None:
    program, *words = shlex.split(command)
    if program == "make":
        assert re.search(rf"^{words[0]}:.*##", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    elif program == "python":
        file = words[1].replace(".", "/") + ".py" if words[0] == "-m" else words[0]
        assert (ROOT / file).is_file()
    elif program == "pip":
        if words == ["install", "-e", "."]:
            return
        named = re.fullmatch(r"\$\(ls (.+)\)\[(.+)\]", words[-1])
        assert named is not None
        wheel, extras = named.groups()
        assert wheel in (ROOT / "Makefile").read_text(encoding="utf-8"), "what `make wheel` leaves"
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        assert set(extras.split(",")) <= set(project["optional-dependencies"])
    else:
        if words == ["--help"]:
            with pytest.raises(SystemExit, match="0"):
                cli.parse(words)
            return
        options = vars(cli.parse(words))
        if options["verb"] in CONFIGS:
            given.settings(CONFIGS[options["verb"]], None, options["set"])


@pytest.mark.parametrize("page", PAGES)
def test_every_setting_and_verb_that_a_document_names_exists(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert [v for v in re.findall(r"`twin ([a-z]+)`", text) if v not in cli.VERBS] == []
    for assignment in re.findall(r"--set ([a-z_.]+=[^\s`]+)", text):
        refused = []
        for config in dict.fromkeys(CONFIGS.values()):
            try:
                given.settings(config, None, [assignment])
            except ConfigError as e:
                refused.append(str(e))
        assert len(refused) < len(set(CONFIGS.values())), refused


def test_a_setting_that_does_not_exist_is_found() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'labels\.window'"):
        given.settings(CONFIGS["reconstruct"], None, ["labels.window=5"])


@pytest.mark.parametrize("page", PAGES)
def test_the_engines_of_twin_check_are_counted_alike(page: str) -> None:
    """Where fewer were measured, the page says of how many."""
    numbers = ["two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"]
    text = (ROOT / page).read_text(encoding="utf-8")
    counted = re.findall(rf"\b({'|'.join(numbers)}) (?:\w+ )?engines\b", text)
    assert set(counted) <= {numbers[len(verification.ENGINES) - 2]}


def test_what_only_parses_is_in_the_documents() -> None:
    told = {c for _, c in ALL}
    assert [c for c in (*ONLY_PARSED, RECONSTRUCTED, INSPECTED) if c not in told] == []
    assert [word for word in SNIPPETS_PARSED if not any(word in code for _, code in SNIPPETS)] == []
    assert [a for a in (*SMALLER,) if not any(a in c for c in (*told, *(code for _, code in SNIPPETS)))] == []


def test_blocks_without_a_language_hold_commands_or_drawings() -> None:
    """A command that begins with another word would not be seen."""
    drawn = re.compile(r"[─►▼▲◄→·]|^(RUN|twin)/ |^ {5,}\S|^$", re.MULTILINE)
    for page in PAGES:
        for language, block in blocks(page):
            assert language in ("", "python"), f"{page}: a test has to read {language}"
            others = [x for x in block.splitlines() if not COMMAND.match(x)] if not language else []
            assert [x for x in others if not drawn.search(x)] == [], page


@pytest.mark.parametrize(("page", "code"), SNIPPETS)
def test_every_snippet_names_what_exists(page: str, code: str) -> None:
    """It compiles, what it imports of Funtwin is there, and so is every `package.name`."""
    tree = ast.parse(dedented(code))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in (
            "recon",
            "robots",
            "twin",
        ):
            for name in node.names:
                assert hasattr(import_module(str(node.module)), name.name), f"{node.module}.{name.name}"
    assert page
    for package, name in re.findall(r"\b(recon|robots|twin)\.([a-z_]+)\(", code):
        assert hasattr(import_module(package), name), f"{package}.{name}"


def slower(clip: Recording, factor: float) -> Recording:
    """Long enough for what the pages cut out of a recording."""
    assert clip.poses is not None
    times = clip.times[0] + factor * (clip.times - clip.times[0])
    return replace(clip, times=times, poses=replace(clip.poses, times=times[clip.poses.frames]))


def write_calibration(folder: Path, clip: Recording) -> None:
    k = clip.intrinsics
    camera = Calibration(Lens(k), None, None, None)
    folder.mkdir()
    (folder / "calibration.json").write_text(camera.text, encoding="utf-8")


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with RUN, an exported cabinet whose parts are called NAME and door, and SCENE.xml with a joint
    NAME."""
    place = tmp_path_factory.mktemp("documents")
    twin = cabinet_twin()
    named = [replace(p, name="NAME") if p.name == "drawer" else p for p in twin.parts]
    save(replace(twin, parts=tuple(named)), place / "RUN" / "twin")
    (place / "RUN" / "config.toml").write_text(to_toml(ReconConfig()), encoding="utf-8")
    assert cli.run(["export", str(place / "RUN"), "--json"]) == 0
    pulls = [f"{k / 20},{24 if k < 4 else 4}" for k in range(30)]
    (place / "pull.csv").write_text("\n".join(["angle_rad,force_N", *pulls]), encoding="utf-8")
    scene = asset("scenes/base_cabinet.xml").read_text(encoding="utf-8")
    (place / "assets").symlink_to(asset("scenes").parent)
    (place / "SCENE.xml").write_text(scene.replace("drawer_top", "NAME"), encoding="utf-8")
    clip = slower(phone_recording(place / "clip"), 20.0)
    write_recording(clip, place / "RECORDING")
    write_calibration(place / "CAMERA", clip)
    for name, write in DEVICES.items():
        write(clip, place / name)
    return place


@pytest.fixture
def place(exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy that a command may change, as the folder where it is run."""
    shutil.copytree(exported, tmp_path / "place", symlinks=True)
    monkeypatch.chdir(tmp_path / "place")
    return tmp_path / "place"


@pytest.mark.usefixtures("place")
@pytest.mark.parametrize("command", QUICK)
def test_quick_commands_run_as_they_stand(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        report_page, "_pictures", lambda _: {"opening": [], "dollhouse": "", "plan": ""}
    )  # has tests of its own
    for line in [*([FIRST[command]] if command in FIRST else []), command]:
        assert cli.run(words_of(line)) == 0, capsys.readouterr().err


def python(code: str, folder: Path) -> str:
    """What a program prints that is run in the folder."""
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("command", SLOW)
def test_robot_and_rendering_commands_run_as_they_stand(
    command: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if command.startswith("twin simulate"):  # writes the folder that other commands read
        shutil.rmtree(place / "RECORDING")
    if command.startswith("twin trajectory"):
        assert cli.run(["replay", "RUN", "--robot", "franka"]) == 0, capsys.readouterr().err
    assert cli.run(words_of(command)) == 0, capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("command", CALIBRATE)
def test_calibrations_run_as_they_stand(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On rendered pictures of the board that the page has."""
    monkeypatch.chdir(tmp_path)
    T = np.asarray(make_pose(translation=[-0.03, 0.0, 0.0]))
    write_boards(tmp_path / "made", texture(9, 6, "5X5_250"), 0.03, T, 18)
    for name, made in (("color", "color"), ("ir", "infrared"), ("depth", "depth")):
        (tmp_path / "made" / made).rename(tmp_path / name)
    board = re.search(r"`({\"type\": [^`]*})`", (ROOT / "docs/calibrating.md").read_text(encoding="utf-8"))
    assert board is not None
    (tmp_path / "board.json").write_text(board[1], encoding="utf-8")
    words = [f for w in words_of(command) for f in (sorted(map(str, Path().glob(w))) if "*" in w else [w])]
    assert cli.run(words) == 0, capsys.readouterr().err
    assert (tmp_path / "CAMERA" / "calibration.json").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("command", RECONSTRUCT)
def test_reconstructions_run_as_they_stand(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the shipped recording, with the camera poses of its truth as known ones; then everything said about
    measures."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(asset("recordings/cabinet_drawer"), "RECORDING")
    shutil.copy("RECORDING/truth/trajectory.txt", "RECORDING")
    if "RUN/config.toml" in command:
        Path("RUN").mkdir()
        Path("RUN/config.toml").write_text(to_toml(ReconConfig()), encoding="utf-8")
    source = open_recording("RECORDING")
    for name in set(words_of(command)) & set(DEVICES):
        DEVICES[name](source, tmp_path / name)
        # a phone's depth has a tenth of the pixels: not trusted is no failure of the command
        assert cli.run(words_of(command)) in (0, 2), capsys.readouterr().err
        return
    for line in (INSPECTED, command):
        assert cli.run(words_of(line)) == 0, capsys.readouterr().err
    written = words_of(command)[words_of(command).index("-o") + 1]
    assert cli.run(words_of(RECONSTRUCTED.replace("RUN", written))) == 0, capsys.readouterr().out
    for page, code in SNIPPETS:
        if page == "docs/metrics.md":
            assert "ATE" in python(code.replace('"RUN"', repr(written)), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted({page for page, _ in SNIPPETS if page != "docs/metrics.md"}))
def test_snippets_run_as_they_stand(page: str, place: Path) -> None:
    """A page's snippets one after the other, as its reader meets them."""
    codes = [dedented(c) for p, c in SNIPPETS if p == page and not any(w in c for w in SNIPPETS_PARSED)]
    code = BEFORE.get(page, "") + "\n".join(codes)
    for more, smaller in SMALLER.items():
        code = code.replace(more, smaller)
    told = python(f"if __name__ == '__main__':\n    exec({code!r})", place)
    assert page != "README.md" or "opened" in told
