"""Mass and inertia of surfaces against closed forms: every board counts once, whichever of its sides were
seen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenes.boards import Board, boards_inertial, boards_mesh, door_boards, drawer_boards
from twin import geometry as geo
from twin.errors import SceneError
from twin.geometry import Array
from twin.physics.mass_bounds import shape_bounds
from twin.physics.materials import Material, read_materials
from twin.physics.surface_mass import shell_inertial
from twin.quantities import Inertial, Quantity
from twin.scene import Mesh

PANEL = Board((0.1, -0.2, 0.3), (0.5, -0.182, 0.9))
TILTED = geo.make_pose(geo.exp_so3([0.3, -0.5, 0.9]), [1.0, 2.0, 0.5])
SAMPLED = 0.015  # rims are weighed by a few points behind each face


def exact(value: float) -> Quantity:
    return Quantity(value, "test", (value, value))


def board(thickness: float = 0.018, density: float = 700.0) -> Material:
    return Material("test_board", exact(density), exact(thickness), exact(0.5))


def faces_of(mesh: Mesh, keep: Array) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[keep], mesh.colors)


def frames(mesh: Mesh) -> tuple[Array, Array]:
    """Normals and centres (F, 3)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return geo.unit(np.cross(b - a, c - a)), (a + b + c) / 3


def tensor_ratios(got: Array, want: Array) -> Array:
    """Extremes of the ratio of both tensors' moments over all axes."""
    return np.sort(np.linalg.eigvals(np.linalg.solve(want, got)).real)


def tray(t: float, bottom: float | None = None) -> list[Board]:
    """A drawer without its front: 0.5 x 0.4 x 0.15 m, boards that touch."""
    w, d, h, b = 0.5, 0.4, 0.15, bottom or t
    return [
        Board((0, 0, 0), (w, t, h)),
        Board((0, d - t, 0), (w, d, h)),
        Board((0, t, 0), (t, d - t, h)),
        Board((w - t, t, 0), (w, d - t, h)),
        Board((t, t, 0), (w - t, d - t, b)),
    ]


SEEN: dict[str, Callable[[Array], Array]] = {
    "all": lambda n: np.ones(len(n), bool),
    "not the back": lambda n: n[:, 1] < 0.5,
    "not one rim": lambda n: n[:, 0] > -0.5,
    "front and two rims": lambda n: (n[:, 1] < 0.5) & (n[:, 0] > -0.5) & (n[:, 2] > -0.5),
    "the front alone": lambda n: n[:, 1] < -0.5,
    "front and back": lambda n: abs(n[:, 1]) > 0.5,
}


@pytest.mark.parametrize("seen", SEEN)
def test_a_board_counts_once_whichever_sides_were_seen(seen: str) -> None:
    mesh = boards_mesh([PANEL], cut=3)
    got = shell_inertial(faces_of(mesh, SEEN[seen](frames(mesh)[0])).transformed(TILTED), board())
    want = boards_inertial([PANEL], TILTED)
    rimless = seen in ("the front alone", "front and back")
    assert got.mass.value == pytest.approx(want.mass.value, rel=1e-5 if rimless else SAMPLED)
    assert np.linalg.norm(got.com - want.com) < (1e-5 if rimless else 1e-3)
    ratios = tensor_ratios(got.inertia, want.inertia)
    assert ratios[0] > 0.99
    assert ratios[-1] < 1.03


@pytest.mark.parametrize(
    ("boards", "unseen", "off"),
    [
        (tray(0.018), None, 0.01),
        (tray(0.018), "underside", 0.06),  # a bottom seen from above reaches as far down as the sides' rims
        (drawer_boards(), None, 0.01),
        (door_boards(), "back of the panel", 0.01),
    ],
    ids=["tray", "tray from above", "drawer", "door from the front"],
)
def test_hollow_furniture_weighs_its_boards(boards: list[Board], unseen: str | None, off: float) -> None:
    mesh = boards_mesh(boards, cut=2)
    n, c = frames(mesh)
    if unseen == "underside":
        mesh = faces_of(mesh, n[:, 2] > -0.5)
    elif unseen:
        mesh = faces_of(mesh, ~((n[:, 1] > 0.5) & (c[:, 1] > -0.01)))
    got, want = shell_inertial(mesh, board()), boards_inertial(boards, np.eye(4))
    hull = float(np.prod(np.ptp(mesh.vertices, axis=0))) * 700.0
    assert got.mass.value == pytest.approx(want.mass.value, rel=off)
    assert got.mass.value < 0.65 * hull, "the hollow is empty"
    assert np.linalg.norm(got.com - want.com) < 4e-3
    ratios = tensor_ratios(got.inertia, want.inertia)
    assert ratios[0] > 0.98
    assert ratios[-1] < 1.08


def test_a_box_of_thin_sheet_weighs_area_times_thickness() -> None:
    size, t = np.array([0.4, 0.5, 0.3]), 0.001
    got = shell_inertial(boards_mesh([Board((0, 0, 0), tuple(size))], cut=2), board(t, 7800.0))
    area = 2 * (size[0] * size[1] + size[0] * size[2] + size[1] * size[2])
    assert got.mass.value == pytest.approx(area * t * 7800, rel=1e-3)
    assert np.allclose(got.com, size / 2, atol=1e-5)


def test_a_bar_weighs_what_it_holds() -> None:
    """All four sides are seen and each other's rims: counted by pairs it would weigh twice as much."""
    bar = Board((0, 0, 0), (0.012, 0.012, 0.3))
    got = shell_inertial(boards_mesh([bar], cut=4), board())
    assert got.mass.value == pytest.approx(0.012**2 * 0.3 * 700, rel=SAMPLED)
    mesh = boards_mesh([bar], cut=4)
    n, _ = frames(mesh)
    open_ended = shell_inertial(faces_of(mesh, abs(n[:, 2]) < 0.5), board())
    assert open_ended.mass.value == pytest.approx(0.012**2 * 0.3 * 700, rel=0.02)


def test_a_gap_in_front_of_a_panel_is_not_material() -> None:
    front = Board((0, 0, 0), (0.4, 0.018, 0.4))
    bar = Board((0.1, -0.040, 0.19), (0.3, -0.022, 0.21))
    together = shell_inertial(boards_mesh([front, bar], cut=2), board()).mass.value
    assert together == pytest.approx(boards_inertial([front, bar], np.eye(4)).mass.value, rel=SAMPLED)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_any_surface_gives_a_lawful_inertia_that_turns_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-0.15, 0.15, (12, 3)) * [1, 1, 0 if seed % 2 else 1]  # flat for odd seeds
    faces = np.stack([rng.permutation(12)[:3] for _ in range(6)]).astype(np.int32)
    mesh = Mesh(vertices, faces)
    got = shell_inertial(mesh, board())  # Inertial checks positive definite and triangle inequality
    turned = shell_inertial(mesh.transformed(TILTED), board())
    r = TILTED[:3, :3]
    scale = np.trace(got.inertia)
    assert np.allclose(turned.inertia, r @ got.inertia @ r.T, atol=0.02 * scale)
    assert np.allclose(turned.com, geo.transform(TILTED, got.com[None])[0], atol=1e-3)
    assert turned.mass.value == pytest.approx(got.mass.value, rel=5e-3)


@pytest.mark.parametrize(
    ("seed", "seen"), [(0, "all"), (1, "not the back"), (2, "the front alone"), (3, "tray"), (4, "tray")]
)
def test_intervals_hold_whatever_each_board_is_made_of(seed: int, seen: str) -> None:
    """Boards of one part have each their own density and thickness, of which the table knows only the
    bounds."""
    rng = np.random.default_rng(seed)
    material = read_materials().material("furniture_board")
    t, other = rng.uniform(*material.thickness.interval, 2)
    boards = [PANEL, Board((0.5, -0.2, 0.3), (0.51, -0.2 + t, 0.9))] if seen != "tray" else tray(t, other)
    mesh = boards_mesh(boards, cut=2)
    keep = SEEN.get(seen, SEEN["all"])(frames(mesh)[0])
    got = shell_inertial(faces_of(mesh, keep), material)
    want = mixed([boards_inertial([b], np.eye(4), rng.uniform(*material.density.interval)) for b in boards])
    assert got.mass.interval[0] <= want.mass.value <= got.mass.interval[1]
    assert np.all(got.com_interval[0] <= want.com)
    assert np.all(want.com <= got.com_interval[1])
    ratios = tensor_ratios(want.inertia, got.inertia)
    assert got.inertia_interval[0] <= ratios[0]
    assert ratios[-1] <= got.inertia_interval[1]


def mixed(bodies: list[Inertial]) -> Inertial:
    """One body of several: masses add, tensors by the parallel axis theorem."""
    m = np.array([b.mass.value for b in bodies])
    com = m @ np.array([b.com for b in bodies]) / m.sum()
    tensor = np.zeros((3, 3))
    for b in bodies:
        d = b.com - com
        tensor += b.inertia + b.mass.value * (d @ d * np.eye(3) - np.outer(d, d))
    total = float(m.sum())
    return Inertial(Quantity(total, "other: closed form", (total, total)), com, tensor)


def test_bounds_are_reached_by_a_spread_and_passed_by_none() -> None:
    """A rod of five pieces: all 2^5 corners of the weights give the bounds by trying."""
    x = np.linspace(-0.2, 0.2, 5)
    points = np.stack([x, np.zeros(5), np.zeros(5)], axis=1)
    mass, light, heavy = np.full(5, 1.0), np.full(5, 0.6), np.full(5, 1.7)
    tensor = np.diag([1e-4, float(mass @ x**2), float(mass @ x**2)])
    (low, high), box = shape_bounds([points], (light, mass, heavy), np.zeros(3), tensor)
    corners = np.array([[heavy[k] if i >> k & 1 else light[k] for k in range(5)] for i in range(32)])
    centres = corners @ x / corners.sum(axis=1)
    about_own = np.array([w @ (x - c) ** 2 / w.sum() for w, c in zip(corners, centres, strict=True)])
    about_fixed = corners @ x**2 / corners.sum(axis=1)
    usual = float(x @ x) / 5
    assert box[0, 0] == pytest.approx(centres.min())
    assert box[1, 0] == pytest.approx(centres.max())
    assert low == pytest.approx(about_own.min() / usual)
    assert high == pytest.approx(about_fixed.max() / usual)
    assert high >= about_own.max() / usual


def test_a_weighed_mass_narrows_what_the_tensor_can_be() -> None:
    got = shell_inertial(boards_mesh([PANEL], cut=2), read_materials().material("furniture_board"))
    low, high = got.inertia_interval
    weighed = got.with_mass(Quantity(4.0, "measured: scale", (3.9, 4.1)))
    assert np.allclose(weighed.inertia / 4.0, got.inertia / got.mass.value)
    assert low < 0.6 * weighed.inertia_interval[0]
    assert high > 1.1 * weighed.inertia_interval[1]
    back = weighed.with_mass(got.mass)
    assert np.allclose(back.inertia_interval, (low, high))
    assert np.array_equal(weighed.com, got.com)


def test_a_mesh_without_area_is_refused() -> None:
    with pytest.raises(SceneError, match="no area"):
        shell_inertial(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])), board())
