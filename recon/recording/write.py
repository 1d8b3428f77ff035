"""Writing any recording in a layout of ours: native, or that of TUM RGB-D."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.recording import MIN_FRAMES, Recording
from twin import geometry as geo
from twin.errors import InputError
from twin.files.atomic import put, staging
from twin.geometry import Array
from twin.runs.loop import Loop, untold

Layout = Literal["native", "tum"]
MILLIMETRES = 1000.0  # counts a metre of the native layout without `depth_scale`
# Counts a metre for depth between mm, the finest whose range holds it: to 6.5, 13.1, 32.7 and 65.5 m.
FINER = (10000.0, 5000.0, 2000.0, MILLIMETRES)
TUM_PER_METRE = 5000.0  # the layout's own
MAX_COUNT = 65535
MIN_COUNT = 30  # readers take an image without any larger count for one in metres
WHOLE = 1e-3  # counts, chosen by us: float32 metres tell millimetres that well to 8 m
# Levels of PNG: higher ones take several times as long for 2 % fewer bytes. Chosen by us.
COLOR_LEVEL = 3
DEPTH_LEVEL = 4


@dataclass(frozen=True)
class Written:
    """A recording that was written: the folder, its frames, and what did not come along."""

    path: Path
    frames: int
    warnings: tuple[str, ...]


def write_recording(
    recording: Recording, out: Path | str, layout: Layout = "native", progress: Loop = untold
) -> Written:
    """Write a recording into a new folder, which stands there at the end, whole, or not at all.

    Colour becomes PNG, as it is. Depth becomes 16-bit PNG: in the native layout in mm where all of it is
    whole mm, else with more counts a metre (`depth_scale` in intrinsic.json; rounded by 0.05 mm at most to
    6.5 m); 5000 a metre in TUM's. Frames without any depth, which the layouts do not allow, and depth that 16
    bits don't hold are left out with a warning, beside those of the recording.

    Raises:
        InputError: `out` holds files or can't be written, the layout is unknown, or too few frames have
            depth.
    """
    if layout not in get_args(Layout):
        raise InputError(f"unknown layout {layout!r}", f"write {' or '.join(get_args(Layout))}")
    out = Path(out)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists and is not an empty folder", "choose a new folder for the recording")
    names = ("color", "depth") if layout == "native" else ("rgb", "depth")
    with _whole(out) as staged:
        for name in names:
            (staged / name).mkdir()
        depth = _Depth(recording, staged / "depth", TUM_PER_METRE if layout == "tum" else None)
        kept = depth.write(progress)
        for place, k in enumerate(progress(kept, "colour images")):
            _png(staged / names[0] / f"{place:06d}.png", recording.color(k)[..., ::-1], COLOR_LEVEL)
        warnings = [*recording.warnings, *depth.warnings]
        if layout == "native":
            warnings += _native(recording, staged, kept, depth.per_metre)
        else:
            warnings += _tum(recording, staged, kept)
    return Written(out, len(kept), tuple(warnings))


@contextmanager
def _whole(out: Path) -> Iterator[Path]:
    try:
        with staging(out.resolve()) as staged:
            yield staged
            put(staged, out.resolve(), ())
    except OSError as error:
        raise InputError(
            f"can't write the folder {out}: {error.strerror}", "choose another place, or make room"
        ) from error


@dataclass
class _Depth:
    """Writes depth images; counts a metre are found on the way, earlier ones written again."""

    recording: Recording
    folder: Path
    fixed: float | None
    per_metre: float = MILLIMETRES
    beyond: int = 0
    kept: list[int] = field(default_factory=list)
    too_far: bool = False  # mm although some depth lies between: it is too far for more counts

    def write(self, progress: Loop) -> list[int]:
        """The frames that were written. Raises InputError when they are too few for a recording."""
        self.per_metre = self.fixed or MILLIMETRES
        for k in progress(range(len(self.recording)), "depth images"):
            self._frame(k)
        if len(self.kept) < MIN_FRAMES:
            raise InputError(
                f"{self.recording.source}: {len(self.kept)} of {len(self.recording)} frames have depth, "
                f"{MIN_FRAMES} are needed",
                "record again",
            )
        return self.kept

    @property
    def warnings(self) -> list[str]:
        name, told = self.recording.name, []
        lost = len(self.recording) - len(self.kept)
        if lost:
            told.append(f"{name}: {lost} of {len(self.recording)} frames hold no depth, and are left out")
        if self.beyond:
            far = MAX_COUNT / self.per_metre
            told.append(f"{name}: {self.beyond} depth values are beyond {far:.1f} m, and written as unknown")
        return told

    def _frame(self, k: int) -> None:
        metres = self._read(k)
        if self.fixed is None and self._finer(metres):
            before, self.kept, self.beyond = self.kept, [], 0
            for file in self.folder.iterdir():
                file.unlink()
            for j in before:
                self._put(j, self._read(j))
        self._put(k, metres)

    def _read(self, k: int) -> Array:
        metres = self.recording.depth(k).astype(np.float64)
        return np.where(np.isfinite(metres) & (metres > 0), metres, 0.0)

    def _finer(self, metres: Array) -> bool:
        """Whether this image asks for other counts a metre, which are then set."""
        wanted = self.per_metre
        if self.per_metre == MILLIMETRES and not self.too_far:
            counts = metres * MILLIMETRES
            if np.any(np.abs(counts - np.rint(counts)) > WHOLE * np.maximum(1.0, counts / 8000.0)):
                wanted = FINER[0]
        top = float(metres.max())
        while wanted != MILLIMETRES and np.rint(top * wanted) > MAX_COUNT:
            wanted = FINER[FINER.index(wanted) + 1]
            self.too_far = wanted == MILLIMETRES
        changed, self.per_metre = wanted != self.per_metre, wanted
        return changed

    def _put(self, k: int, metres: Array) -> None:
        counts = np.rint(metres * self.per_metre)
        over = counts > MAX_COUNT
        image = np.where(over, 0.0, counts).astype(np.uint16)
        if image.max() < MIN_COUNT:
            return
        self.beyond += int(over.sum())
        _png(self.folder / f"{len(self.kept):06d}.png", image, DEPTH_LEVEL)
        self.kept.append(k)


def _native(recording: Recording, folder: Path, kept: list[int], per_metre: float) -> list[str]:
    _intrinsics(recording, folder, {} if per_metre == MILLIMETRES else {"depth_scale": per_metre})
    times = recording.times[kept]
    _text(folder / "timestamps.txt", [[t] for t in times])
    _trajectory(recording, folder / "trajectory.txt", kept)
    data: dict[str, Any] = {k: v for k, v in recording.metadata.items() if k == "description"}
    gravity, warnings = recording.gravity_camera0, []
    if gravity is not None:
        turned = _gravity(recording, kept[0], gravity)
        if turned is None:
            warnings.append(
                f"{recording.name}: gravity is told in the axes of a frame that is left out, and lost"
            )
        else:
            data["gravity_camera0"] = turned.tolist()
    if data:
        (folder / "metadata.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return warnings


def _tum(recording: Recording, folder: Path, kept: list[int]) -> list[str]:
    _intrinsics(recording, folder, {})
    times = recording.times[kept]
    for name in ("rgb", "depth"):
        lines = [f"{float(t)!r} {name}/{k:06d}.png\n" for k, t in enumerate(times)]
        (folder / f"{name}.txt").write_text("# timestamp filename\n" + "".join(lines), encoding="utf-8")
    _trajectory(recording, folder / "groundtruth.txt", kept)
    if recording.gravity_camera0 is None:
        return []
    return [f"{recording.name}: the layout of TUM RGB-D has no place for gravity, which is lost"]


def _gravity(recording: Recording, first: int, gravity: Array) -> Array | None:
    """Gravity in the axes of frame `first`; None where the turn between the frames is not known."""
    if first == 0:
        return np.asarray(gravity)
    poses = None if recording.poses is None else (recording.poses.pose(0), recording.poses.pose(first))
    if poses is None or poses[0] is None or poses[1] is None:
        return None
    return np.asarray(poses[1][:3, :3].T @ poses[0][:3, :3] @ gravity)


def _intrinsics(recording: Recording, folder: Path, more: dict[str, float]) -> None:
    k = recording.intrinsics
    matrix = [float(v) for v in (k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1)]
    data = {"width": k.width, "height": k.height, "intrinsic_matrix": matrix, **more}
    (folder / "intrinsic.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _trajectory(recording: Recording, file: Path, kept: list[int]) -> None:
    """TUM lines of the poses of the frames that are kept; no file without any."""
    poses = recording.poses
    if poses is None:
        return
    there = np.isin(poses.frames, kept)
    if not there.any():
        return
    write_tum_poses(file, recording.times[poses.frames[there]], poses.T_world_cam[there])


def write_tum_poses(path: Path, times: Array, T_world_cam: Array) -> None:
    """TUM lines of times (n,) s and poses (n, 4, 4), camera to world."""
    quat = geo.quat_wxyz_from_matrix(T_world_cam[:, :3, :3])[:, [1, 2, 3, 0]]
    _text(path, np.column_stack([times, T_world_cam[:, :3, 3], quat]))


def _text(path: Path, rows: Any) -> None:
    """Numbers with as many digits as bring them back bit by bit."""
    path.write_text("".join(" ".join(repr(float(v)) for v in row) + "\n" for row in rows), encoding="utf-8")


def _png(path: Path, image: NDArray[Any], level: int) -> None:
    good, data = cv2.imencode(".png", np.ascontiguousarray(image), [cv2.IMWRITE_PNG_COMPRESSION, level])
    if not good:
        raise InputError(f"can't encode {path.name}", "check the size of the images")
    path.write_bytes(data.tobytes())
