"""Render twins from their recordings' own cameras and compare with the frames: vertex colours, and photo
textures.

    python benchmarks/look.py RECORDING ... [--runs FOLDER] [--sheets FOLDER] [--table FILE]

Every 12th frame is rendered, and textures are made without them (`texture.skip_every=12`); vertex colours do
use them. Coverage: share of the pixels of known depth up to 3 m, without the true hand, that the twin covers
within 3 cm. Over these, after one gain per channel: PSNR in dB, and sharpness, the gradient energy of the
rendered picture over that of the frame. Textures are sampled by Keys' cubic kernel. Recordings need
truth/labels, which tell the hand apart.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d

from recon.config import ReconConfig
from recon.pipeline import reconstruct
from recon.readers import open_recording
from recon.recording import Recording
from recon.texture.photo_textures import TextureConfig
from twin import geometry as geo
from twin.scene import HAND_LABEL, Mesh, Twin

EVERY = 12
FARTHEST, WITHIN = 3.0, 0.03  # m


@dataclass(frozen=True)
class Look:
    """Of one recording and one way to colour it, means over the frames."""

    coverage: float
    psnr: float
    sharpness: float


def keys(t: np.ndarray) -> np.ndarray:
    """Keys' cubic kernel, a = -0.5."""
    t = np.abs(t)
    near, far = (1.5 * t - 2.5) * t * t + 1, ((-0.5 * t + 2.5) * t - 4) * t + 2
    return np.where(t < 1, near, np.where(t < 2, far, 0.0))


def sampled(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Colours (n, 3) of an image (H, W, 3) at uv (n, 2), v up."""
    h, w = image.shape[:2]
    x, y = uv[:, 0] * w - 0.5, (1.0 - uv[:, 1]) * h - 0.5
    out = np.zeros((len(uv), 3))
    for dy in range(-1, 3):
        for dx in range(-1, 3):
            i, j = np.floor(y).astype(int) + dy, np.floor(x).astype(int) + dx
            weight = keys(y - i) * keys(x - j)
            out += weight[:, None] * image[np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)]
    return out


def bodies(twin: Twin, frame: int) -> list[Mesh]:
    """The meshes as they stood at a frame; parts without a state then stay where they were."""
    out = [twin.static.mesh]
    for p in twin.parts:
        state = float(np.interp(frame, p.motion.frames, p.motion.state))
        out.append(p.mesh.transformed(p.joint.pose(state)))
    return out


def rendered(
    meshes: list[Mesh], recording: Recording, pose: np.ndarray, photo: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Picture (H, W, 3) and depth (H, W) m, infinite where nothing is hit."""
    k = recording.intrinsics
    scene = o3d.t.geometry.RaycastingScene()
    for m in meshes:
        scene.add_triangles(m.vertices.astype(np.float32), m.faces.astype(np.uint32))
    v, u = np.mgrid[: k.height, : k.width]
    ahead = k.backproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.shape))
    rays = np.concatenate([np.broadcast_to(pose[:3, 3], ahead.shape), ahead @ pose[:3, :3].T], axis=-1)
    hit = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))
    body, face = hit["geometry_ids"].numpy(), hit["primitive_ids"].numpy()
    second = hit["primitive_uvs"].numpy()
    weights = np.concatenate([1.0 - second.sum(axis=-1, keepdims=True), second], axis=-1)
    picture = np.zeros((k.height, k.width, 3))
    for n, m in enumerate(meshes):
        at = body == n
        f, w = face[at], weights[at]
        if photo:
            assert m.texture is not None
            picture[at] = sampled(m.texture.image, np.einsum("nk,nkd->nd", w, m.texture.uv[f]))
        else:
            assert m.colors is not None
            picture[at] = np.einsum("nk,nkc->nc", w, m.colors[m.faces[f]])
    return picture, hit["t_hit"].numpy()


def gradient(picture: np.ndarray) -> np.ndarray:
    """Squared gradient (H, W) of brightness."""
    across, along = np.gradient(picture.mean(axis=-1))
    return np.asarray(across**2 + along**2)


def compared(twin: Twin, recording: Recording, truth: Path, photo: bool, sheet: Path | None) -> Look:
    """Look of a twin; `sheet` takes four frames, each beside its rendering."""
    assert twin.cameras is not None
    rows, tiles = [], []
    for frame in range(0, len(recording), EVERY):
        pose = twin.cameras.pose(frame)
        if pose is None:
            continue
        color, depth = recording.frame(frame)
        label = cv2.imread(str(truth / "labels" / f"{frame:06d}.png"), cv2.IMREAD_UNCHANGED)
        picture, z = rendered(bodies(twin, frame), recording, pose, photo)
        asked = (label != HAND_LABEL) & (depth > 0) & (depth < FARTHEST)
        fits = asked & np.isfinite(z) & (np.abs(np.where(np.isfinite(z), z, 0.0) - depth) < WITHIN)
        real = color.astype(float)
        gain = real[fits].mean(axis=0) / np.maximum(picture[fits].mean(axis=0), 1.0)
        picture = np.clip(picture * gain, 0, 255)
        psnr = 10 * np.log10(255**2 / np.mean((picture[fits] - real[fits]) ** 2))
        inner = cv2.erode(fits.astype(np.uint8), np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)) > 0
        sharp = gradient(picture)[inner].mean() / gradient(real)[inner].mean()
        rows.append((fits.sum() / asked.sum(), psnr, sharp))
        tiles.append(np.concatenate([real, np.where(np.isfinite(z)[..., None], picture, 255)], axis=1))
    if sheet is not None:
        some = np.linspace(0, len(tiles) - 1, 4).round().astype(int)
        cv2.imwrite(str(sheet), np.concatenate([tiles[k] for k in some])[..., ::-1].astype(np.uint8))
    return Look(*(float(v) for v in np.mean(rows, axis=0)))


def texel_mm(mesh: Mesh) -> tuple[float, float]:
    """Median and 95th percentile over a textured surface of a texel's larger extent, mm."""
    assert mesh.texture is not None
    h, w = mesh.texture.image.shape[:2]
    corners, flat = mesh.vertices[mesh.faces], mesh.texture.uv * np.array([w, h])
    across = np.stack([flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]], axis=-1)
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    fine = np.abs(np.linalg.det(across)) > 1e-3
    jacobian = sides[fine] @ np.linalg.inv(across[fine])
    size = 1000 * np.linalg.norm(jacobian, ord=2, axis=(1, 2))
    order, area = np.argsort(size), geo.triangle_areas(corners)[fine]
    share = np.cumsum(area[order]) / area.sum()
    return tuple(float(size[order][np.searchsorted(share, q)]) for q in (0.5, 0.95))  # type: ignore[return-value]


def rows_of(path: Path, runs: Path, sheets: Path | None) -> list[str]:
    """Lines of the table for one recording."""
    recording, name = open_recording(path), path.name
    start = time.perf_counter()
    config = ReconConfig(texture=TextureConfig(skip_every=EVERY))
    twin = reconstruct(recording, config, out=runs / name)
    print(f"{name}: {time.perf_counter() - start:.1f} s")
    out = []
    for photo in (False, True):
        what = "photo texture" if photo else "vertex colours"
        sheet = None if sheets is None else sheets / f"{name}_{'photo' if photo else 'vertex'}.png"
        look = compared(twin, recording, path / "truth", photo, sheet)
        out.append(f"| {name} | {what} | {look.psnr:.1f} dB | {look.sharpness:.2f} | {look.coverage:.1%} |")
    print("\n".join(out))
    for body in (twin.static, *twin.parts):
        texture = body.mesh.texture
        assert texture is not None
        h, w = texture.image.shape[:2]
        print(
            f"  {body.name}: {w} x {h} px, texel {texel_mm(body.mesh)} mm, seen {seen_share(body.mesh):.1%}"
        )
    return out


def seen_share(mesh: Mesh) -> float:
    """Share of a textured surface that a picture shows, by the middles of its faces."""
    assert mesh.texture is not None
    h, w = mesh.texture.image.shape[:2]
    at = mesh.texture.uv.mean(axis=1) * [w, h]
    x, y = np.clip(at.astype(int), 0, [w - 1, h - 1]).T
    area = geo.triangle_areas(mesh.vertices[mesh.faces])
    return float((area * mesh.texture.seen[h - 1 - y, x]).sum() / area.sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--runs", type=Path, help="keep the runs there, and go on from them")
    parser.add_argument("--sheets", type=Path, help="frames beside their renderings go there")
    parser.add_argument("--table", type=Path)
    args = parser.parse_args()
    if args.sheets is not None:
        args.sheets.mkdir(parents=True, exist_ok=True)
    rows = ["| recording | colours | PSNR | sharpness | coverage |", "|---|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as temporary:
        for path in args.recordings:
            rows += rows_of(path, args.runs or Path(temporary), args.sheets)
    if args.table is not None:
        args.table.write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
