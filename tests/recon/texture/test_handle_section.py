"""How thick a bar is by its outline in photographs, ray cast in closed form: its true width comes back, or
nothing does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.recording import Intrinsics, Recording
from recon.simulate.ray_caster import Caster
from recon.texture.handle_section import Profile, handle_sections, width_of, with_handles
from tests.makers.twin import scans
from twin import geometry as geo
from twin.completion.infer import infer
from twin.geometry import Array
from twin.inferred import box_mesh
from twin.scene import HAND_LABEL, STATIC_LABEL, Part, Trajectory, Twin
from twin.storage import digest, load, save

CAMERA = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
FRAMES = range(0, 30, 3)
FRONT, BAR, FLANK = (150, 110, 70), (200, 200, 210), (120, 120, 130)
MIDDLE = np.mean(scans.BAR, axis=0)


def pose(frame: int) -> Array:
    """From below to 30 degrees above the bar, 60 cm away, and a little aside."""
    up, aside = np.radians(-10 + 40 * frame / 30), 0.2 * np.sin(frame)
    eye = MIDDLE + 0.6 * np.array([np.sin(aside), -np.cos(up) * np.cos(aside), np.sin(up)])
    ahead = geo.unit(MIDDLE - eye)
    right = geo.unit(np.cross(ahead, [0.0, 0.0, 1.0]))
    return geo.make_pose(np.stack([right, np.cross(ahead, right), ahead], axis=1), eye)


def picture(part: Part, thickness: float, plain: bool, frame: int) -> Array:
    """(H, W, 3) of a front with a bar before it, both moved as the part is in this frame; plain: in one
    colour."""
    at = np.interp(frame, part.motion.frames, part.motion.state)
    T = geo.invert_pose(part.joint.pose(float(at))) @ pose(frame)
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    ways = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    ways = geo.unit(geo.rotate(T, ways.reshape(-1, 3)))
    rays = np.concatenate([np.broadcast_to(T[:3, 3], ways.shape), ways], axis=1)
    size = np.array([0.16, thickness, thickness])
    middle = np.array([MIDDLE[0], scans.BAR[0][1] + thickness / 2, MIDDLE[2]])
    caster, alone = Caster(), Caster()
    boxes = [box_mesh(geo.make_pose(translation=middle), size), box_mesh(geo.make_pose(translation=[0, 0.5, 0.7]), np.array([2.0, 1.0, 2.0]))]  # fmt: skip
    for mesh in boxes:
        caster.add(mesh.vertices, mesh.faces)
    alone.add(boxes[0].vertices, boxes[0].faces)
    near, far = caster.first(rays)[0], alone.first(rays)[0]
    on_bar = np.isfinite(far) & (far <= near + 1e-5)
    hit = rays[:, :3] + np.where(on_bar, far, 0.0)[:, None] * ways
    front = on_bar & (np.abs(hit[:, 1] - scans.BAR[0][1]) < 1e-4)
    color = np.where(front[:, None], BAR, np.where(on_bar[:, None], FLANK, FRONT))
    color = np.full_like(color, FRONT) if plain else color
    return color.reshape(CAMERA.height, CAMERA.width, 3).astype(np.uint8)


def filmed(thickness: float, plain: bool = False, hand: bool = False) -> tuple[Twin, Recording]:
    twin = scans.twin_of(scans.drawer())
    (part,) = twin.parts
    n = len(part.motion.frames)
    poses = np.stack([pose(f) for f in range(n)])
    pictures = {f: picture(part, thickness, plain, f) for f in FRAMES}
    empty = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    recording = Recording.from_arrays(
        color=np.stack([pictures.get(f, empty) for f in range(n)]),
        depth=np.ones((n, CAMERA.height, CAMERA.width), np.float32),
        intrinsics=CAMERA.matrix,
        fps=15,
    )
    label = HAND_LABEL if hand else STATIC_LABEL
    labels = {f: np.full((CAMERA.height, CAMERA.width), label, np.uint8) for f in FRAMES}
    cameras = Trajectory(np.arange(n), np.arange(n) / 15, poses)
    return replace(twin, labels=labels, cameras=cameras), recording


@pytest.mark.parametrize("thickness", [0.010, 0.014, 0.020])
def test_a_bar_is_as_thick_as_its_outline(thickness: float) -> None:
    """Also while the drawer moves; its fused surface, 24 mm thick, is the same each time."""
    found = handle_sections(*filmed(thickness))
    assert abs(found[2].width - thickness) < 0.001
    assert np.linalg.norm(found[2].middle - [*MIDDLE[:1], scans.BAR[0][1], MIDDLE[2]]) < 0.01
    assert found[2].photographs > 4


def test_nothing_is_told_of_what_looks_like_its_front_or_of_what_a_hand_is_near() -> None:
    assert handle_sections(*filmed(0.014, plain=True)) == {}
    assert handle_sections(*filmed(0.014, hand=True)) == {}


@pytest.mark.parametrize("side", [-1, 1])
def test_the_flank_that_is_lit_like_the_front_is_none_of_the_width(side: int) -> None:
    rng, x, profiles = np.random.default_rng(3), np.arange(-90, 91) * 0.0005, []
    for angle in np.radians(np.linspace(15, 50, 8)):
        on = (side * x > -0.008) & (side * x < 0.008 + 0.016 * np.tan(angle))
        color = np.where(on[:, None], 200.0, 100.0) + rng.normal(0, 2, (len(x), 3))
        profiles.append(Profile(color, side * angle, 0.002))
    found = width_of(profiles, 0.03)
    assert found is not None
    assert abs(found - 0.016) < 0.001


def test_noise_has_no_width() -> None:
    rng = np.random.default_rng(3)
    noise = [Profile(rng.normal(120, 20, (181, 3)), angle, 0.002) for angle in np.linspace(-0.4, 0.4, 12)]
    assert width_of(noise, 0.02) is None
    assert width_of(noise[:2], 0.02) is None


def test_what_is_inferred_takes_the_measured_thickness_and_says_so(tmp_path: Path) -> None:
    twin, recording = filmed(0.020)
    measured = with_handles(twin, handle_sections(twin, recording))
    save(replace(measured, labels={}), tmp_path / "twin")
    again = load(tmp_path / "twin")
    assert again.parts[0].handle is not None
    assert digest(again) == digest(replace(measured, labels={}))
    assert digest(again) != digest(replace(twin, labels={}))
    layer = infer(again).parts[0].completion
    assert layer is not None
    bar = next(p for p in layer.pieces if p.name == "handle")
    size = np.ptp(bar.mesh.vertices, axis=0)
    assert np.abs(size[1:] - 0.020).max() < 0.002
    assert "by its outline in" in bar.reason
    assert "assumed" not in bar.reason
    assert bar.basis == "evidence"
    untold = infer(replace(twin, labels={})).parts[0].completion
    assert untold is not None
    assert {p.basis for p in untold.pieces if p.role == "handle"} == {"assumed"}
