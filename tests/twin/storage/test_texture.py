"""Photo textures keep their laws in memory, come back from the disk as they were, and change nothing else of
a twin."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from recon.verdict.assemble import keep_twin
from twin import geometry as geo
from twin.errors import InputError, SceneError
from twin.exporters.texture import photo_atlas
from twin.runs.stages import Run
from twin.scene import Mesh, Texture, Twin
from twin.storage import digest, load, save, update
from twin.storage.texture import same_textures


def texture_for(mesh: Mesh, seed: int = 0, side: int = 64) -> Texture:
    """A random texture in which each face has a small triangle of its own."""
    rng = np.random.default_rng(seed)
    grid = int(np.ceil(np.sqrt(len(mesh.faces))))
    k = np.arange(len(mesh.faces))
    origin = np.stack([k % grid, k // grid], axis=1)[:, None] + 0.2
    uv = (origin + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])) / grid
    image = rng.integers(0, 256, (side, 2 * side, 3), dtype=np.uint8)
    return Texture(uv.astype(np.float32), image, rng.random((side, 2 * side)) < 0.5)


def dressed(seed: int = 0) -> Twin:
    """A cabinet whose scene and first part have textures; the second has none."""
    twin = cabinet_twin(nested=True)

    def with_texture(mesh: Mesh) -> Mesh:
        return replace(mesh, texture=texture_for(mesh, seed))

    first = replace(twin.parts[0], mesh=with_texture(twin.parts[0].mesh))
    return replace(
        twin, static=replace(twin.static, mesh=with_texture(twin.static.mesh)), parts=(first, *twin.parts[1:])
    )


def files_in(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_textures_refuse_what_they_cannot_hold() -> None:
    mesh = cabinet_twin().static.mesh
    good = texture_for(mesh)
    with pytest.raises(SceneError, match=r"0\.\.1"):
        replace(good, uv=good.uv + 1.0)
    with pytest.raises(SceneError, match="mask"):
        replace(good, seen=good.seen[1:])
    with pytest.raises(SceneError, match="needs an image"):
        replace(good, image=np.zeros((0, 4, 3), np.uint8), seen=np.zeros((0, 4), bool))
    with pytest.raises(SceneError, match="does not fit"):
        replace(mesh, texture=replace(good, uv=good.uv[1:]))
    moved = replace(mesh, texture=good).transformed(geo.make_pose(np.eye(3), [1.0, 0, 0]))
    assert moved.texture is good


def test_they_come_back_from_the_disk_and_change_nothing_else(tmp_path: Path) -> None:
    bare, twin = cabinet_twin(nested=True), dressed()
    save(bare, tmp_path / "bare")
    save(twin, tmp_path / "twin")
    found = load(tmp_path / "twin")
    assert same_textures(found, twin)
    assert not found.extra
    assert not found.parts[0].extra
    plain, full = files_in(tmp_path / "bare"), files_in(tmp_path / "twin")
    assert all(full[name] == data for name, data in plain.items() if name != "twin.json")
    part = twin.parts[0].name
    assert set(full) - set(plain) == {
        f"textures/{n}.{e}" for n in (twin.static.name, part) for e in ("png", "uv.npy")
    }
    assert digest(found) == digest(bare)
    save(found, tmp_path / "again")
    again = files_in(tmp_path / "again")
    assert all(again[name] == data for name, data in full.items() if name != "cameras.txt")


def test_a_saved_twin_takes_its_old_textures_along_or_away(tmp_path: Path) -> None:
    folder = tmp_path / "twin"
    save(dressed(), folder)
    (folder / "textures" / "mine.png").write_bytes(b"mine")
    save(dressed(1), folder)
    assert same_textures(load(folder), dressed(1))
    save(cabinet_twin(nested=True), folder)
    assert [p.name for p in (folder / "textures").iterdir()] == ["mine.png"]
    part = cabinet_twin(nested=True).static.name
    (folder / "textures" / f"{part}.png").write_bytes(b"not ours")
    save(dressed(), folder)
    assert (folder / "textures" / f"{part}.png").read_bytes() == b"not ours"
    assert same_textures(load(folder), dressed())


def test_an_update_does_not_lose_a_texture_silently(tmp_path: Path) -> None:
    twin = dressed()
    save(twin, tmp_path / "twin")
    update(twin, replace(twin, name="other"), tmp_path / "twin")
    assert same_textures(load(tmp_path / "twin"), twin)
    with pytest.raises(InputError, match="texture"):
        update(twin, dressed(1), tmp_path / "twin")


def test_an_equal_twin_in_the_run_takes_over_new_textures(tmp_path: Path) -> None:
    with Run(tmp_path, "0" * 64) as run:
        keep_twin(run, dressed(), tmp_path)
        kept = keep_twin(run, dressed(1), tmp_path)
    assert same_textures(kept, dressed(1))
    assert same_textures(load(tmp_path), dressed(1))
    assert not list(tmp_path.glob("twin_before*"))


def spoil_head(data: bytes) -> bytes:
    return data[:6] + b"\x09" + data[7:]


@pytest.mark.parametrize(
    ("file", "spoil", "told"),
    [
        ("png", lambda d: d[:0], "no picture"),
        ("png", lambda d: d[: len(d) // 8], "picture"),
        ("png", lambda d: b"GIF89a" + d, "no picture"),
        ("uv.npy", lambda d: d[:0], "no NumPy array"),
        ("uv.npy", spoil_head, "no NumPy array"),
        ("uv.npy", lambda d: d[:-8], "bytes of numbers"),
        ("uv.npy", lambda d: d.replace(b"<f4", b"<f8"), "float64"),
        ("uv.npy", lambda d: d.replace(b"<f4", b"|O8"), "object"),
        ("uv.npy", lambda d: d[:-4] + np.float32(7).tobytes(), r"0\.\.1"),
        ("uv.npy", lambda d: d[:-4] + np.float32(np.nan).tobytes(), "not finite"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, file: str, spoil: Callable[[bytes], bytes], told: str) -> None:
    twin = dressed()
    save(twin, tmp_path / "twin")
    path = tmp_path / "twin" / "textures" / f"{twin.static.name}.{file}"
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(InputError, match=told) as error:
        load(tmp_path / "twin")
    assert path.name in str(error.value)
    assert "\n" not in str(error.value)


def test_bad_names_are_named(tmp_path: Path) -> None:
    save(dressed(), tmp_path / "twin")
    file = tmp_path / "twin" / "twin.json"
    document = json.loads(file.read_text())
    for wrong in ({"image": "../out.png", "uv": "x"}, {"image": 3, "uv": "x"}, {}, "textures"):
        document["static"]["texture"] = wrong
        file.write_text(json.dumps(document))
        with pytest.raises(InputError, match=r"static\.texture"):
            load(tmp_path / "twin")
    document["static"]["texture"] = {"image": "textures/gone.png", "uv": "textures/gone.npy"}
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"gone\.png"):
        load(tmp_path / "twin")


def test_some_faces_get_a_smaller_image_with_the_same_texels() -> None:
    mesh = dressed().static.mesh
    assert mesh.texture is not None
    whole = photo_atlas(mesh)
    assert whole.image is mesh.texture.image
    assert np.array_equal(whole.uv, mesh.texture.uv.reshape(-1, 2))
    keep = np.array([7, 2, 3])
    some = photo_atlas(mesh, keep)
    assert some.image is not None
    assert some.image.size < mesh.texture.image.size
    assert np.array_equal(some.order, keep)
    for uv, face in zip(some.uv.reshape(-1, 3, 2), keep, strict=True):
        here, there = texels(some.image, uv), texels(mesh.texture.image, mesh.texture.uv[face])
        assert np.array_equal(here, there)


def texels(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The texels under points of a triangle, its corners' and its middle's."""
    points = np.concatenate([uv, uv.mean(axis=0, keepdims=True)])
    h, w = image.shape[:2]
    x, y = np.floor(points[:, 0] * w + 1e-4), np.floor((1 - points[:, 1]) * h + 1e-4)
    return np.asarray(image[y.astype(int), x.astype(int)])
