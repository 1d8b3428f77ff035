"""Twins on disk: `twin.json` (format "funtwin/1"), `cameras.txt`, `meshes/*.ply`, `labels/*.png`.

Numbers are written with as many digits as it takes to read back the same double, so a saved and loaded twin is the
same twin (camera rotations, stored as quaternions, to 1e-12). docs/twin_format.md describes the format.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.errors import InputError
from twin.paths import AnyPath
from twin.ply import ply_bytes
from twin.scene import Collision, Joint, Mesh, Part, Quantity, Revolute, Trajectory, Twin

FORMAT = "funtwin/1"


def save(twin: Twin, folder: AnyPath) -> None:
    """Write the twin into `folder` (usually RUN/twin): all of it appears at once, or nothing changes.

    Raises InputError when the folder can't be written or holds something that is not a twin.
    """
    folder = Path(folder)
    require_place(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as e:
        raise InputError(
            f"{folder} can't be written: {e.strerror}", "give a folder that you may write"
        ) from e
    try:
        _write(twin, temporary)
        temporary.chmod(0o755)
        _swap(temporary, folder)
    except OSError as e:
        raise InputError(
            f"{folder} can't be written: {e.strerror or e}", "check space and permissions"
        ) from e
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def require_place(folder: Path) -> None:
    """Raises InputError unless a twin may be written there: a new or empty folder, or one that holds a twin."""
    if folder.exists() and (
        not folder.is_dir() or (any(folder.iterdir()) and not (folder / "twin.json").exists())
    ):
        raise InputError(
            f"{folder} exists and does not hold a twin", "give a new or empty folder, e.g. RUN/twin"
        )


def load(folder: AnyPath) -> Twin:
    """Read a twin from RUN/twin, or from RUN itself. Labels are read when they are looked at.

    Raises InputError that names the file, the field and its value.
    """
    from twin.storage_read import read_twin

    return read_twin(twin_folder(folder))


def twin_folder(folder: AnyPath) -> Path:
    """The folder that holds twin.json: RUN/twin, given itself or RUN. Raises InputError when there is none."""
    folder = Path(folder)
    here = folder if (folder / "twin.json").is_file() else folder / "twin"
    if not (here / "twin.json").is_file():
        raise InputError(f"{folder} holds no twin.json", "give a run folder or its folder twin/")
    return here


def save_values(twin: Twin, folder: AnyPath) -> None:
    """Replace twin.json alone, at once, for a twin whose numbers changed while its meshes, cameras and labels did not.

    Raises InputError when a mesh of the twin is not in the folder, or the folder can't be written.
    """
    here = twin_folder(folder)
    meshes: dict[str, Mesh] = {}
    text = json_text(twin_document(twin, meshes)) + "\n"
    absent = [name for name in meshes if not (here / name).is_file()]
    if absent:
        raise InputError(f"{here / absent[0]} does not exist", "save the whole twin with twin.save")
    try:
        handle, name = tempfile.mkstemp(prefix=".twin.json-", dir=here)
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as out:
                out.write(text)
                out.flush()
                os.fsync(out.fileno())
            Path(name).chmod((here / "twin.json").stat().st_mode & 0o777)
            Path(name).replace(here / "twin.json")
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as e:
        raise InputError(f"{here} can't be written: {e.strerror}", "give a folder that you may write") from e


class LabelFolder(Mapping[int, "NDArray[np.uint8]"]):
    """Label images of a folder by recording frame, each read when it is asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        names = sorted(p.stem for p in folder.glob("*.png")) if folder.is_dir() else []
        bad = [n for n in names if not n.isdecimal()]
        if bad:
            raise InputError(
                f"{folder / bad[0]}.png is not named by a frame number", "name labels like 000012.png"
            )
        self._frames = {int(n): n for n in names}

    def __getitem__(self, frame: int) -> NDArray[np.uint8]:
        import cv2

        path = self._folder / f"{self._frames[frame]}.png"
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None or image.ndim != 2 or image.dtype != np.uint8:
            raise InputError(f"{path} is not a single-channel 8-bit PNG", "labels are written by twin.save")
        return np.asarray(image, dtype=np.uint8)

    def __iter__(self) -> Iterator[int]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)


def _swap(new: Path, folder: Path) -> None:
    """Put the finished folder `new` in the place of `folder`."""
    if not folder.exists():
        new.rename(folder)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{folder.name}-old-", dir=folder.parent))
    folder.rename(old / "twin")
    new.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _write(twin: Twin, folder: Path) -> None:
    meshes: dict[str, Mesh] = {}
    document = twin_document(twin, meshes)
    (folder / "meshes").mkdir()
    for name, mesh in meshes.items():
        (folder / name).write_bytes(ply_bytes(mesh))
    if twin.cameras is not None:
        (folder / "cameras.txt").write_text(_tum(twin.cameras), encoding="ascii")
    if twin.labels:
        import cv2

        (folder / "labels").mkdir()
        for frame in sorted(twin.labels):
            ok, png = cv2.imencode(".png", twin.labels[frame])
            if not ok:
                raise InputError(
                    f"label image of frame {frame} can't be written as PNG", "labels are (H, W) uint8"
                )
            (folder / "labels" / f"{frame:06d}.png").write_bytes(png.tobytes())
    with (folder / "twin.json").open("w", encoding="utf-8", newline="\n") as out:
        out.write(json_text(document) + "\n")
        out.flush()
        os.fsync(out.fileno())


def _tum(cameras: Trajectory) -> str:
    """TUM lines `t tx ty tz qx qy qz qw`, camera to world."""
    lines = []
    for t, pose in zip(cameras.times, cameras.T_world_cam, strict=True):
        w, x, y, z = geo.quat_wxyz_from_matrix(pose[:3, :3])
        lines.append(" ".join([_time(float(t)), *(repr(float(v)) for v in (*pose[:3, 3], x, y, z, w))]))
    return "\n".join(lines) + "\n"


def _time(t: float) -> str:
    short = f"{t:.6f}"
    return short if float(short) == t else repr(t)


def twin_document(twin: Twin, meshes: dict[str, Mesh]) -> dict[str, Any]:
    """The content of twin.json; every mesh it names is added to `meshes` under its path relative to twin.json."""
    static = twin.static
    meshes[f"meshes/{static.name}.ply"] = static.mesh
    r = twin.recorded
    return {
        "format": FORMAT,
        "name": twin.name,
        "recording": None
        if r is None
        else {"source": r.source, "frames": r.frames, "fingerprint": r.fingerprint},
        "provenance": dict(twin.provenance),
        "cameras": None
        if twin.cameras is None
        else {"file": "cameras.txt", "frames": twin.cameras.frames.tolist()},
        "static": {
            "name": static.name,
            "mesh": f"meshes/{static.name}.ply",
            "collision": _collision(static.name, static.collision, meshes),
        },
        "parts": [_part(p, meshes) for p in twin.parts],
    }


def _part(p: Part, meshes: dict[str, Mesh]) -> dict[str, Any]:
    meshes[f"meshes/{p.name}.ply"] = p.mesh
    m = p.motion
    return {
        "id": p.id,
        "name": p.name,
        "parent": p.parent,
        "mesh": f"meshes/{p.name}.ply",
        "collision": _collision(p.name, p.collision, meshes),
        "joint": _joint(p, p.joint),
        "motion": {
            "frames": m.frames.tolist(),
            "times": m.times.tolist(),
            "state": m.state.tolist(),
            "intervals": [list(i) for i in m.intervals],
            "residual": float(m.residual),
            "inliers": float(m.inliers),
        },
        "inertial": _inertial(p),
        "physics": None
        if p.physics is None
        else {
            k: _quantity(getattr(p.physics, k)) for k in ("friction", "damping", "frictionloss", "density")
        },
        "contact": _contact(p),
    }


def part_document(part: Part) -> dict[str, Any]:
    """What twin.json says about a part."""
    return _part(part, {})


def _joint(p: Part, j: Joint) -> dict[str, Any]:
    s = j.sigma
    return {
        "type": j.kind,
        "axis": j.axis.tolist(),
        "pivot": j.pivot.tolist() if isinstance(j, Revolute) else None,
        "lower": float(j.lower),
        "upper": float(j.upper),
        "limits_source": p.limits_source,
        "closed_source": p.closed_source,
        "type_source": p.type_source,
        "sigma": None
        if s is None
        else {"axis_deg": float(f"{np.rad2deg(s.axis):.12g}"), "pivot_m": s.pivot, "state": float(s.state)},
        "covariance": None if j.covariance is None else j.covariance.tolist(),
    }


def _inertial(p: Part) -> dict[str, Any] | None:
    if p.inertial is None:
        return None
    i, q, factors, box = (
        p.inertial.inertia,
        p.inertial.mass,
        p.inertial.inertia_interval,
        p.inertial.com_interval,
    )
    return {
        "mass": float(q.value),
        "com": p.inertial.com.tolist(),
        "inertia": [float(i[a, b]) for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
        "source": q.source,
        "mass_interval": [float(v) for v in q.interval],
        "inertia_source": p.inertial.inertia_source,
        "inertia_interval": None if factors is None else list(factors),
        "com_interval": None if box is None else box.tolist(),
    }


def _contact(p: Part) -> dict[str, Any] | None:
    c = p.contact
    if c is None:
        return None
    return {
        "point": c.point.tolist(),
        "rotation": c.rotation.tolist(),
        "width": float(c.width),
        "frames": [int(f) for f in c.frames],
        "source": c.source,
    }


def _quantity(q: Quantity) -> dict[str, Any]:
    return {"value": float(q.value), "source": q.source, "interval": [float(v) for v in q.interval]}


def _collision(name: str, pieces: tuple[Collision, ...], meshes: dict[str, Mesh]) -> list[Any]:
    out: list[Any] = []
    for k, piece in enumerate(pieces):
        if isinstance(piece, Mesh):
            path = f"meshes/{name}.collision.{k:03d}.ply"  # a dot: no part's name holds one
            meshes[path] = piece
            out.append(path)
        else:
            t = piece.T_world_box
            out.append(
                {
                    "center": t[:3, 3].tolist(),
                    "rotation": t[:3, :3].tolist(),
                    "size": piece.size.tolist(),
                }
            )
    return out


def json_text(value: Any, indent: int = 0) -> str:
    """JSON with one line for a list of plain values and indentation for the rest; refuses NaN and infinity."""
    pad = " " * (indent + 1)
    if isinstance(value, dict) and value:
        rows = [
            f"{pad}{json.dumps(str(k), ensure_ascii=False)}: {json_text(v, indent + 1)}"
            for k, v in value.items()
        ]
        return "{\n" + ",\n".join(rows) + "\n" + " " * indent + "}"
    if isinstance(value, list | tuple) and any(isinstance(v, dict | list | tuple) for v in value):
        rows = [pad + json_text(v, indent + 1) for v in value]
        return "[\n" + ",\n".join(rows) + "\n" + " " * indent + "]"
    try:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as e:
        raise InputError(
            f"twin.json can't hold the value {value!r}", "use finite numbers and JSON types only"
        ) from e
