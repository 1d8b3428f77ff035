"""Files as they arrive: whole ones are recognised and opened by every verb, broken ones are told in one line
and change nothing."""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import re
import shutil
import signal
import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from recon.readers import READERS, open_recording
from recon.recording import Recording
from tests.makers.recon.layouts import LAYOUTS, write_layout
from tests.makers.recon.phone_recording import phone_recording
from twin.cli.main import run
from twin.errors import FuntwinError

FLIPS = 10_000
WITHOUT_TIMES = ("hoi4d", "bundlesdf", "itaco_rendered", "itaco_real")  # so many frames a second


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return phone_recording(tmp_path_factory.mktemp("source") / "clip")


@pytest.fixture(scope="module")
def samples(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Path]]:
    """By case: the folder around what was written, and the path to open, relative to it."""
    made = {}
    for case in LAYOUTS:
        folder = tmp_path_factory.mktemp(case)
        made[case] = (folder, write_layout(case, recording, folder).relative_to(folder))
    return made


def state(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in folder.rglob("*")
        if p.is_file()
    }


def told_in_one_line(path: Path, place: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """`twin convert` ends with 1 and one line, and leaves the disk as it was."""
    before = state(place)
    capfd.readouterr()
    assert run(["convert", str(path), "-o", str(place / "out")]) == 1
    said = capfd.readouterr()
    lines = [line for line in said.err.splitlines() if line.startswith("twin: ")]
    assert len(lines) == 1, said.err
    assert "Traceback" not in said.err + said.out
    assert state(place) == before
    assert not (place / "out").exists()
    return lines[0]


@pytest.mark.parametrize("case", LAYOUTS)
def test_every_layout_is_recognised_and_converted(
    case: str, samples: dict[str, tuple[Path, Path]], recording: Recording, tmp_path: Path
) -> None:
    folder, path = samples[case]
    before = state(folder)
    reader = LAYOUTS[case][0]
    assert next(n for n, r in READERS.items() if r.recognises(folder / path)) == reader
    opened = open_recording(folder / path)
    assert len(opened) == len(recording)
    if case not in WITHOUT_TIMES:
        np.testing.assert_allclose(np.diff(opened.times), np.diff(recording.times), atol=5e-4)
    assert opened.intrinsics.fx / opened.intrinsics.width == pytest.approx(80 / 96, rel=0.01)
    for k in (0, 13, len(opened) - 1):
        frame, original = opened.frame(k), recording.frame(k)
        both = (frame.depth > 0) & (original.depth > 0)
        assert np.mean(both) > 0.5
        assert np.median(np.abs(frame.depth - original.depth)[both]) < 0.01
        assert np.mean(np.abs(frame.color.astype(int) - original.color)) < 12
    assert run(["convert", str(folder / path), "-o", str(tmp_path / "out"), "--start", "0.2"]) == 0
    assert len(open_recording(tmp_path / "out")) < len(recording)
    assert open_recording(tmp_path / "out").frame(0).depth.shape == opened.frame(0).depth.shape
    assert state(folder) == before


def files_of(path: Path) -> list[Path]:
    """A recording's files, of numbered ones the first alone."""
    found = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    kinds: dict[tuple[Path, str], Path] = {}
    for p in found:
        kinds.setdefault((p.parent, p.suffix), p)
    return list(kinds.values())


# what is done to each kind of file of each layout
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "half": lambda data: data[: len(data) // 2],
    "other": lambda _: b"hello, this is no such file\n" * 40,
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("case", LAYOUTS)
def test_broken_files_are_told_or_left_out(
    case: str,
    damage: str,
    samples: dict[str, tuple[Path, Path]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Whatever file of a layout is broken: one line and exit code 1, or a recording that was read without it,
    with whole frames."""
    folder, path = samples[case]
    place = Path(shutil.copytree(folder, tmp_path / "copy"))
    told = 0
    for broken in files_of(place / path):
        whole = broken.read_bytes()
        broken.write_bytes(DAMAGES[damage](whole))
        if not is_read(place / path):
            told_in_one_line(place / path, place, capfd)
            told += 1
        broken.write_bytes(whole)
    assert told > 0 or damage == "half"  # of which the frames before may be enough


def is_read(path: Path) -> bool:
    """With whole frames; else it is refused."""
    with suppress_refusals():
        for frame in open_recording(path):
            assert frame.depth.any()
        return True
    return False


@contextmanager
def suppress_refusals() -> Iterator[None]:
    """What users can cause passes, everything else is an error; nothing may hang."""
    with ending_within(20):
        try:
            yield
        except FuntwinError as error:
            if "\n" in str(error):
                raise AssertionError(f"not one line: {error}") from error


@contextmanager
def ending_within(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"over {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def swapped(folder: Path) -> None:
    (folder / "color").rename(folder / "x")
    (folder / "depth").rename(folder / "color")
    (folder / "x").rename(folder / "depth")


def wrong_clock(folder: Path) -> None:
    """A list whose "times" are the durations of frames, as a camera's tool once wrote it."""
    lines = (folder / "rgb.txt").read_text().splitlines()
    rows = [line.split() for line in lines if not line.startswith("#")]
    (folder / "rgb.txt").write_text("".join(f"0.033 {name}\n" for _, name in rows))


def other_clock(folder: Path) -> None:
    rows = [line.split() for line in (folder / "depth.txt").read_text().splitlines() if line[0] != "#"]
    (folder / "depth.txt").write_text("".join(f"{float(t) + 5000} {name}\n" for t, name in rows))


def bomb(path: Path) -> None:
    """A member of 80 MB in 80 kB."""
    with zipfile.ZipFile(path) as old:
        members = {n: old.read(n) for n in old.namelist() if n != "rgbd/0.depth"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in members.items():
            new.writestr(name, data)
        with new.open("rgbd/0.depth", "w", force_zip64=True) as member:
            for _ in range(80):
                member.write(bytes(2**20))


def other_compression(path: Path) -> None:
    """Both heads of every member name a way to compress that nobody knows."""
    data = bytearray(path.read_bytes())
    for head, at in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        for found in re.finditer(re.escape(head), bytes(data)):
            data[found.start() + at] = 77
    path.write_bytes(bytes(data))


def outwards(path: Path) -> None:
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../../evil.txt", "x")


class Evil:
    """What unpickles into a file."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("touch evil.txt",)


def pickled(name: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        file = next(folder.rglob(name))
        buffer = io.BytesIO()
        np.save(buffer, np.array([Evil()], dtype=object), allow_pickle=True)
        data = buffer.getvalue()
        if file.suffix == ".npz":
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr("a.npy", data)
        else:
            file.write_bytes(data)

    return write


def all_pickle(folder: Path) -> None:
    next(folder.rglob("*.npy")).write_bytes(pickle.dumps(Evil()))


def huge_picture(folder: Path) -> None:
    """A PNG that says to have 65535x65535 pixels."""
    file = next((folder / "depth").glob("*.png"))
    data = bytearray(file.read_bytes())
    data[16:24] = struct.pack(">II", 65535, 65535)
    file.write_bytes(bytes(data))


def eight_bits(folder: Path) -> None:
    file = next((folder / "depth").glob("*.png"))
    cv2.imwrite(str(file), (cv2.imread(str(file), -1) // 256).astype(np.uint8))


def linked_out(folder: Path) -> None:
    (folder / "rgb.txt").write_text("0.0 ../../../etc/passwd\n" * 3)


def truncated_index(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:60])


def without(*names: str) -> Callable[[Path], None]:
    def remove(folder: Path) -> None:
        for name in names:
            for found in list(folder.rglob(name)):
                shutil.rmtree(found) if found.is_dir() else found.unlink()

    return remove


# name -> layout, what is done to it, words of the line
CASES: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "colour and depth swapped": ("native", swapped, "no PNG|channels|not 16-bit"),
    "depth in 8 bits": ("native", eight_bits, "8-bit"),
    "a picture that claims to be huge": ("native", huge_picture, "65535|readable"),
    "no intrinsics": ("native", without("intrinsic.json"), "intrinsic.json"),
    "no depth folder": ("native", without("depth"), "depth"),
    "durations for times": ("tum", wrong_clock, "increase|clock|within"),
    "two clocks": ("tum", other_clock, "one clock"),
    "a list that leads out": ("tum", linked_out, "inside the folder|missing"),
    "zip bomb": ("record3d", bomb, "don't trust"),
    "another compression": ("record3d", other_compression, "damaged"),
    "path out of the archive": ("record3d", outwards, "out of the archive"),
    "no header": ("record3d", truncated_index, "zip"),
    "no times": ("stray_scanner", without("odometry.csv"), "odometry.csv"),
    "no matrix": ("stray_scanner", without("camera_matrix.csv"), "camera_matrix.csv"),
    "no video": ("stray_scanner", without("rgb.mp4"), "rgb.mp4"),
    "no cameras": ("polycam", without("corrected_cameras", "cameras"), "camera"),
    "no metadata": ("record3d_exr", without("metadata.json"), "metadata.json|colour images"),
    "no json": ("scanner_app", without("frame_*.json"), "json|recording"),
    "no pincam": ("arkit_scenes", without("*.pincam"), "pincam|intrinsics"),
    "pickled intrinsics": ("hoi4d", lambda p: pickled("intrin.npy")(p), "intrin.npy"),
    "no camera parameters": ("hoi4d", without("camera_params"), "camera_params|intrin.npy"),
    "pickled depth": ("itaco_rendered", pickled("000000.npz"), "pickle|object|array"),
    "a pickle named npy": ("itaco_rendered", all_pickle, "npy"),
    "pickled real depth": ("itaco_real", pickled("0.npy"), "pickle|object|array"),
    "no cam_K": ("bundlesdf", without("cam_K.txt"), "cam_K.txt"),
    "no camera info": ("arti4d", without("camera_info.txt"), "camera_info.txt"),
    "cut in its header": ("scannet", truncated_index, "truncated|bytes"),
    "cut in its head": ("azure_kinect", truncated_index, "video|holds|colour"),
    "cut in its index": ("ros1", truncated_index, "bag|bytes"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_people_and_attackers_send(
    name: str, samples: dict[str, tuple[Path, Path]], tmp_path: Path, capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    case, damage, words = CASES[name]
    folder, path = samples[case]
    place = Path(shutil.copytree(folder, tmp_path / "in" / "deep" / "here"))
    # the whole tree for what lies beside a clip, as the camera's numbers of a data set
    damage(place if case == "hoi4d" else place / path)
    monkeypatch.chdir(tmp_path)
    with ending_within(20):
        line = told_in_one_line(place / path, place, capfd)
    assert any(w in line for w in words.split("|")), line
    assert not list(tmp_path.rglob("evil*"))


def flips(count: int, samples: dict[str, tuple[Path, Path]], tmp_path: Path) -> int:
    """Flip one to eight bytes of a file of a layout at a time, open it, decode two frames; how often they
    were whole ones."""
    read = 0
    rng = np.random.default_rng(20)
    names = list(samples)
    copies = {c: Path(shutil.copytree(samples[c][0], tmp_path / c)) for c in names}
    for n in range(count):
        case = names[n % len(names)]
        place, path = copies[case], copies[case] / samples[case][1]
        victims = files_of(place)
        victim = victims[rng.integers(len(victims))]
        whole = victim.read_bytes()
        data = bytearray(whole)
        # half of the time near the beginning, where headers are
        reach = len(data) if rng.random() < 0.5 else min(len(data), 400)
        for at in rng.integers(0, reach, rng.integers(1, 9)):
            data[at] = rng.integers(256)
        victim.write_bytes(bytes(data))
        with suppress_refusals():
            opened = open_recording(path, LAYOUTS[case][0])
            frames = [opened.frame(k) for k in (0, len(opened) // 2)]
            size = (opened.intrinsics.height, opened.intrinsics.width)
            read += all(
                f.color.shape[:2] == f.depth.shape == size and np.isfinite(f.depth).all() for f in frames
            )
        victim.write_bytes(whole)
    return read


def test_flipped_bytes_are_refused_or_read(samples: dict[str, tuple[Path, Path]], tmp_path: Path) -> None:
    count = 8 * len(samples)
    assert 0 < flips(count, samples, tmp_path) < count  # what is refused and what is read both occur


@pytest.mark.slow
def test_ten_thousand_flipped_bytes(samples: dict[str, tuple[Path, Path]], tmp_path: Path) -> None:
    assert 0 < flips(FLIPS, samples, tmp_path) < FLIPS


def test_a_layout_named_in_vain_is_told(samples: dict[str, tuple[Path, Path]]) -> None:
    """Every reader, on every other layout's files."""
    opened = []
    for case, (folder, path) in samples.items():
        for name in READERS:
            if name != LAYOUTS[case][0]:
                with suppress_refusals():
                    open_recording(folder / path, name)
                    opened.append((case, name))
    assert opened == []
