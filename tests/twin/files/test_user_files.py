"""What the user put on disk stays: stray files and keys, edited exports, and one process at a time."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.scenes.boards import cabinet_twin
from twin.cli import main as cli
from twin.errors import InputError
from twin.exporters import export
from twin.files import atomic
from twin.runs import stages
from twin.runs.run_lock import claim, claimed, release
from twin.scene import Twin
from twin.storage import keep_aside, load, save, update
from twin.storage.document import extra_of, with_extra

KEYS = st.text("abcdefgh_", min_size=1, max_size=5).map("x_".__add__)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-1, 1) | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)
NAMES = st.text("abcXYZ019 äß-_.", min_size=1, max_size=8).filter(lambda n: n.strip(". ") == n)
PLACES = st.sampled_from(["", "photos", "photos/deep er", "meshes", "labels", "notes.d"])
FILES = st.dictionaries(st.tuples(PLACES, NAMES), st.binary(max_size=20), max_size=6)


def state(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Bytes and modification time of every file below a folder."""
    return {
        p.relative_to(folder).as_posix(): (p.read_bytes(), p.stat().st_mtime_ns)
        for p in folder.rglob("*")
        if p.is_file()
    }


def stray(folder: Path, files: dict[tuple[str, str], bytes]) -> dict[str, tuple[bytes, int]]:
    """Write files beside those of a twin or an export; returns their state."""
    mine = {}
    for (place, name), data in files.items():
        path = folder / place / f"my {name}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        mine[path.relative_to(folder).as_posix()] = data
    now = state(folder)
    return {path: now[path] for path in mine}


def spoken(document: dict, extras: dict) -> None:
    """Put unknown keys at every level."""
    for owner, extra in zip(
        (document, document["static"], document["parts"][0], document["parts"][0]["joint"], document["parts"][0]["inertial"]),
        extras,
        strict=True,
    ):  # fmt: skip
        owner.update(extra)


@pytest.fixture
def bare() -> Twin:
    """Nothing filled in that an export would fill, but for the first part's inertial and physics."""
    twin = cabinet_twin(nested=True)
    parts = [replace(p, collision=(), inertial=None, physics=None) for p in twin.parts]
    parts[0] = replace(parts[0], inertial=twin.parts[0].inertial, physics=twin.parts[0].physics)
    return replace(twin, parts=tuple(parts), static=replace(twin.static, collision=()))


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(files=FILES, extras=st.tuples(*[st.dictionaries(KEYS, VALUES, max_size=2)] * 5))
def test_stray_files_and_unknown_keys_outlive_load_save_and_update(
    tmp_path_factory: pytest.TempPathFactory, bare: Twin, files: dict, extras: tuple
) -> None:
    folder = tmp_path_factory.mktemp("run") / "twin"
    save(bare, folder)
    mine = stray(folder, files)
    document = json.loads((folder / "twin.json").read_text())
    spoken(document, extras)
    (folder / "twin.json").write_text(json.dumps(document))

    there = load(folder)
    save(there, folder)
    assert json.loads((folder / "twin.json").read_text()) == document
    filled = replace(
        there,
        parts=tuple(
            replace(p, collision=cabinet_twin(nested=True).part(p.name).collision) for p in there.parts
        ),
    )
    update(there, filled, folder)
    after = json.loads((folder / "twin.json").read_text())
    for was, now in zip(
        (document["static"], *document["parts"]), (after["static"], *after["parts"]), strict=True
    ):
        assert {k: v for k, v in now.items() if k != "collision"} == {
            k: v for k, v in was.items() if k != "collision"
        }
    assert len(after["parts"][0]["collision"]) == len(filled.parts[0].collision)
    save(load(folder), folder.parent / "copy")
    assert json.loads((folder.parent / "copy" / "twin.json").read_text()) == after
    now = state(folder)
    assert {path: now.get(path) for path in mine} == mine
    assert not list(folder.parent.glob(".*")), "nothing is left behind"


def test_export_changes_in_the_twin_only_what_was_empty(
    tmp_path: Path, bare: Twin, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    save(bare, run / "twin")
    file = run / "twin" / "twin.json"
    document = json.loads(file.read_text())
    for owner in (document["static"], *document["parts"]):  # files of the user's own naming
        new = f"scans/{owner['name']} scan.ply"
        (run / "twin" / "scans").mkdir(exist_ok=True)
        (run / "twin" / owner["mesh"]).rename(run / "twin" / new)
        owner["mesh"] = new
    document["project"] = {"room": "kitchen"}
    document["parts"][0]["joint"]["bought"] = 1987
    file.write_text(json.dumps(document, indent=3))
    (run / "twin" / "photos").mkdir()
    (run / "twin" / "photos" / "a.jpg").write_bytes(b"jpeg")
    (run / "twin" / "empty").mkdir()
    (run / "twin" / "notes.md").write_text("mine")
    # in the way of what the export will write
    hull = run / "twin" / "meshes" / "door.collision.000.ply"
    hull.write_bytes(b"not ours")
    before = state(run / "twin")

    assert cli.run(["export", str(run), "--format", "mjcf"]) == 0
    capsys.readouterr()
    after = state(run / "twin")
    assert {p for p in before if after.get(p) != before[p]} == {"twin.json"}
    assert (run / "twin" / "empty").is_dir()
    now = json.loads(file.read_text())
    assert {k: v for k, v in now.items() if k not in ("static", "parts")} == {
        k: v for k, v in document.items() if k not in ("static", "parts")
    }
    for was, part in zip(document["parts"], now["parts"], strict=True):
        empty = {k for k, v in was.items() if v in (None, [])}
        assert {k for k in part if part[k] != was[k]} <= empty
        assert part["collision"]
        assert part["inertial"]
    assert len(load(run).parts[0].collision) > 0
    # once more: nothing is empty any more
    there = state(run / "twin")
    assert cli.run(["export", str(run), "--format", "mjcf"]) == 0
    assert state(run / "twin") == there


def test_foreign_files_in_an_export_stay_and_stale_ones_of_ours_go(tmp_path: Path) -> None:
    twin = cabinet_twin(nested=True)
    export(twin, tmp_path)
    mine = {}
    for fmt, place in (("mjcf", "assets"), ("urdf", "meshes"), ("usd", "")):
        mine[fmt] = stray(
            tmp_path / fmt, {("", "scene.xml"): b"<mujoco/>", (place, "bolt.obj"): b"o", ("sub", "n"): b""}
        )
    few = replace(twin, parts=twin.parts[:1])
    assert (tmp_path / "urdf" / "meshes" / "drawer_visual.obj").is_file()
    export(few, tmp_path)
    for fmt, files in mine.items():
        now = state(tmp_path / fmt)
        assert {path: now.get(path) for path in files} == files
        assert not [p for p in now if "drawer" in p], "what is not exported any more is gone"
        listed = json.loads((tmp_path / fmt / "files.json").read_text())["files"]
        assert set(listed) | set(files) | {"files.json"} == set(now)


def test_an_export_that_the_user_edited_stops_the_next_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    save(cabinet_twin(), run / "twin")
    assert cli.run(["export", str(run)]) == 0
    edited = run / "export" / "urdf" / "cabinet.urdf"
    edited.write_text(edited.read_text().replace("cabinet", "my_cabinet", 1))
    (run / "export" / "mjcf" / "README.md").unlink()  # what is gone was not edited
    before = state(run / "export")
    capsys.readouterr()
    assert cli.run(["export", str(run)]) == 1
    told = capsys.readouterr().err
    assert "cabinet.urdf was changed since it was exported" in told
    assert "--overwrite" in told
    assert state(run / "export") == before, "no format is written when one can't be"
    assert cli.run(["export", str(run), "--format", "mjcf"]) == 0
    assert cli.run(["export", str(run), "--overwrite"]) == 0
    assert "my_cabinet" not in edited.read_text()
    assert cli.run(["export", str(run)]) == 0


@pytest.mark.parametrize("name", ["cabinet.xml", "assets", "scene.xml/deep.txt"])
def test_a_file_of_the_same_name_that_was_never_exported_is_not_replaced(tmp_path: Path, name: str) -> None:
    path = tmp_path / "mjcf" / name
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    with pytest.raises(InputError, match="is not a file that was exported"):
        export(cabinet_twin(), tmp_path, formats=("urdf", "mjcf"))
    assert path.read_text() == "mine"
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == [path]


def test_links_and_modes_of_the_user_stay(tmp_path: Path) -> None:
    twin, folder = cabinet_twin(), tmp_path / "twin"
    save(twin, folder)
    (tmp_path / "elsewhere").mkdir()
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    (folder / "broken").symlink_to("nowhere")
    private = folder / "private"
    private.mkdir(mode=0o700)
    (private / "key").write_text("secret")
    (private / "key").chmod(0o600)
    inode = (private / "key").stat().st_ino
    linked = tmp_path / "by_link"
    linked.symlink_to(folder)
    save(replace(twin, parts=twin.parts[:1]), linked)
    assert linked.is_symlink()
    assert len(load(folder).parts) == 1
    assert (folder / "link").readlink() == tmp_path / "elsewhere"
    assert (folder / "broken").is_symlink()
    assert private.stat().st_mode & 0o777 == 0o700
    assert (private / "key").stat().st_ino == inode


def test_where_folders_can_not_be_exchanged_nothing_is_lost_either(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file system without RENAME_EXCHANGE, and a process that dies between the two renames."""
    monkeypatch.setattr(atomic, "_exchanged", lambda *_: False)
    twin, folder = cabinet_twin(), tmp_path / "twin"
    save(twin, folder)
    (folder / "mine").write_text("x")
    save(replace(twin, parts=twin.parts[:1]), folder)
    assert len(load(folder).parts) == 1
    assert (folder / "mine").read_text() == "x"
    left = tmp_path / ".twin-dead.tmp"
    left.mkdir()
    folder.rename(left / "old")
    save(twin, folder)
    assert (folder / "mine").read_text() == "x"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["twin"]


def test_a_second_process_on_a_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run"
    save(cabinet_twin(), run / "twin")
    before = state(run)
    hold = (
        "import sys; from pathlib import Path; from twin.runs.run_lock import claim\n"
        "claim(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", hold, str(run)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        for argv in (["export"], ["check"], ["replay"], ["physics", "set"]):
            assert cli.run([*argv, str(run), *(["--mass", "3"] if argv[0] == "physics" else [])]) == 1
            told = capsys.readouterr().err
            assert f"is in use by another process (process {other.pid})" in told
            assert told.count("\n") == 1
        assert {p: v for p, v in state(run).items() if p != ".lock"} == before
    finally:
        other.kill()
        other.communicate()
    with claimed(run):  # a lock ends with its process
        claim(run)
        release(run)
        assert (run / ".lock").read_text() == str(os.getpid())
    assert not (run / ".lock").exists()


def test_a_page_of_the_user_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    (tmp_path / "report.html").write_text("<html>my thesis</html>")
    assert cli.run(["export", str(tmp_path)]) == 1
    assert "is not a report of Funtwin" in capsys.readouterr().err
    assert (tmp_path / "report.html").read_text() == "<html>my thesis</html>"
    assert not (tmp_path / "export").exists()


@given(known=st.dictionaries(KEYS, VALUES), raw=st.dictionaries(KEYS, VALUES))
def test_extra_keys_and_known_ones_make_up_the_whole(known: dict, raw: dict) -> None:
    extra = extra_of(raw, known)
    whole = with_extra(known, extra)
    assert extra_of(whole, known) == extra
    assert set(whole) == set(known) | set(raw)
    assert all(whole[k] == known[k] or isinstance(known[k], dict) for k in known)


def test_a_list_of_the_user_that_bears_the_name_of_ours_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "mjcf").mkdir()
    (tmp_path / "mjcf" / "files.json").write_text('{"my": "list"}')
    with pytest.raises(InputError, match=r"files\.json is not a file that was exported"):
        export(cabinet_twin(), tmp_path, formats=("mjcf",))
    assert (tmp_path / "mjcf" / "files.json").read_text() == '{"my": "list"}'


def test_folders_that_may_not_be_written_leave_nothing_behind(tmp_path: Path) -> None:
    """The old folder's links are removed after the new one took its place; a read-only folder in it kept
    them."""
    twin = cabinet_twin()
    save(twin, tmp_path / "twin")
    locked = tmp_path / "twin" / "archive"
    locked.mkdir()
    (locked / "a.txt").write_text("mine")
    locked.chmod(0o555)
    code = (
        "import ctypes, sys; from pathlib import Path; from twin.storage import load, save\n"
        "for capability in (1, 2):  # what lets root write everywhere\n"
        "    ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)\n"
        "import os; os.execv(sys.executable, [sys.executable, '-c', sys.argv[1], sys.argv[2]])"
    )
    again = (
        "import sys; from dataclasses import replace; from twin.storage import load, save\n"
        "twin = load(sys.argv[1]); save(replace(twin, parts=twin.parts[:1]), sys.argv[1])"
    )
    subprocess.run([sys.executable, "-c", code, again, str(tmp_path / "twin")], check=True)
    assert len(load(tmp_path).parts) == 1
    assert (locked / "a.txt").read_text() == "mine"
    assert [p.name for p in tmp_path.iterdir()] == ["twin"]


def test_a_copy_of_an_earlier_twin_is_whole_or_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    before, link = state(tmp_path), os.link
    calls: list[str] = []

    def ends(source: str, target: str, **options: bool) -> None:
        calls.append(source)
        if len(calls) == 3:
            raise KeyboardInterrupt
        link(source, target, **options)

    monkeypatch.setattr(os, "link", ends)
    with pytest.raises(KeyboardInterrupt):
        keep_aside(tmp_path / "twin")
    assert state(tmp_path) == before
    monkeypatch.undo()
    assert state(keep_aside(tmp_path / "twin")).keys() == state(tmp_path / "twin").keys()


def test_an_error_of_a_full_disk_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "a.json").write_text("old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as told:
        atomic.write_file(tmp_path / "a.json", b"new")
    assert told.value.filename == str(tmp_path / "a.json")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.json", "old")]


def test_a_run_that_can_not_begin_gives_its_folder_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages, "write_text", Mock(side_effect=OSError(errno.EFBIG, "File too large")))
    with pytest.raises(OSError, match="File too large"):
        stages.Run(tmp_path, "fingerprint", config={"a": 1})
    assert not (tmp_path / ".lock").exists()
