"""Sizes of texels, and which photographs are looked at for a face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.dense.noise import GOOD_SENSOR
from recon.recording import Intrinsics
from recon.texture.photo_textures import TextureConfig, _texels
from recon.texture.photos import LOW, Photos, framed, of_body, take
from recon.texture.shade import shade
from tests.recon.texture.test_texture import CAMERA, Scene, cube
from twin.scene import STATIC_LABEL, Mesh


def photos_of_cube() -> Photos:
    scene = Scene()
    shots = take(scene.recording, scene.cameras, scene.labels, sorted(scene.labels), 5.0)
    return of_body(shots, STATIC_LABEL, [np.eye(4)] * len(shots.frames), CAMERA)


def middle_of(photos: Photos) -> Photos:
    """The same photographs with 40 px cut off at each border."""
    cut, low = 40, 40 // LOW
    inner, outer = np.s_[:, cut:-cut, cut:-cut], np.s_[:, low:-low, low:-low]
    c = CAMERA
    camera = Intrinsics(c.width - 2 * cut, c.height - 2 * cut, c.fx, c.fy, c.cx - cut, c.cy - cut)
    images = {name: getattr(photos, name)[inner].copy() for name in ("color", "depth", "trust")}
    return replace(photos, **images, low=photos.low[outer].copy(), camera=camera)


def test_what_is_seen_from_twice_as_far_has_texels_twice_as_large() -> None:
    mesh, photos, config = cube(), photos_of_cube(), TextureConfig(texel=0.05)
    double = Mesh(mesh.vertices * 2.0, mesh.faces)
    T = photos.T_cam_body.copy()
    T[:, :, 3] *= 2.0
    far = replace(photos, depth=photos.depth * 2, T_cam_body=T)
    near_texel, far_texel = (
        _texels(m, None, p, config, GOOD_SENSOR).min() for m, p in ((mesh, photos), (double, far))
    )
    assert far_texel == pytest.approx(2 * near_texel, rel=1e-6)


@pytest.mark.parametrize("cells", [1, 6])
def test_no_photograph_that_shows_a_face_is_passed_over(cells: int) -> None:
    """Of large faces photographs show a corner, an edge or the middle, of small ones all or nothing."""
    mesh, photos = cube(cells), middle_of(photos_of_cube())
    rng = np.random.default_rng(0)
    face = rng.integers(0, len(mesh.faces), 20_000).astype(np.int32)
    weights = rng.dirichlet([1, 1, 1], len(face))
    points = np.einsum("nk,nkd->nd", weights, mesh.vertices[mesh.faces[face]])
    normals = np.sign(points) * (np.abs(points) > 0.1999)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rest = (np.ones((1, len(photos.which), 3)), np.zeros(len(points), np.int64), GOOD_SENSOR)
    among = framed(mesh.vertices[mesh.faces], photos, 0.0)
    some, every = shade(points, normals, photos, *rest, (among, face)), shade(points, normals, photos, *rest)
    assert 0.01 < (every.views > 0).mean() < 0.5
    assert some.color.tobytes() == every.color.tobytes()


def test_a_face_behind_every_camera_is_looked_for_in_none() -> None:
    photos, here = photos_of_cube(), cube()
    behind = here.vertices + [3.0, 3.0, 1.5]
    assert not framed(behind[here.faces], photos, 0.01).any()
    assert framed(here.vertices[here.faces], photos, 0.01).all()
