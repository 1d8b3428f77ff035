"""Calibration: rendered boards with exact truth, real pictures of an Azure Kinect, and pictures that can't be
used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.layouts.boards import (
    COLOR,
    DEPTH,
    SMALL_COLOR,
    SMALL_DEPTH,
    Camera,
    picture,
    pose,
    texture,
    write_boards,
)
from recon.readers.calibration.board import CalibrationBoard
from recon.readers.calibration.calibrate import CalibrationResult, calibrate, write_calibration
from recon.readers.calibration.camera import CameraResult, calibrate_camera, without_wrong_corners
from recon.readers.calibration.file import Calibration, read_calibration
from recon.readers.calibration.lens_fit import Model, fit_lens
from recon.readers.calibration.pictures import Pictures, View, find_boards, read_grey
from recon.recording import Intrinsics
from recon.recording.rig import Lens
from twin.errors import InputError
from twin.geometry import rotation_angle

SQUARE = 0.03
CHARUCO = CalibrationBoard("charuco", 9, 6, SQUARE, 0.021, "5X5_250")
CHECKER = CalibrationBoard("checkerboard", 9, 6, SQUARE)
T_COLOR_DEPTH = pose((0.08, -0.01, 0.005), (-0.032, -0.002, 0.004))
SCALE = 1.012


def files_in(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight small pictures of a ChArUco board by both cameras, and depth maps."""
    out = tmp_path_factory.mktemp("boards") / "charuco"
    cameras = (SMALL_COLOR, SMALL_DEPTH)
    return write_boards(out, texture(9, 6, "5X5_250"), SQUARE, T_COLOR_DEPTH, 8, SCALE, cameras=cameras)


@pytest.fixture(scope="module")
def result(boards: Path) -> CalibrationResult:
    return calibrated(boards)


def calibrated(folder: Path, board: CalibrationBoard = CHARUCO) -> CalibrationResult:
    return calibrate(
        files_in(folder / "color"),
        board,
        depth=files_in(folder / "infrared"),
        depth_maps=files_in(folder / "depth"),
    )


def require_truth(found: CalibrationResult, cameras: tuple[Camera, Camera], by: float) -> None:
    """Within `by` times a thousandth of the focal length, 1 mm and 0.1 degrees."""
    for result, camera in zip((found.color, found.depth), cameras, strict=True):
        assert result is not None
        k = result.lens.camera
        assert abs(k.fx / camera.fx - 1) < 1e-3 * by
        assert abs(k.fy / camera.fy - 1) < 1e-3 * by
        assert abs(k.cx - camera.cx) < by
        assert abs(k.cy - camera.cy) < by
        assert result.rms < 0.15
        # wherever boards were seen, the lens bends as the camera does
        rays = cv2.undistortPoints(result.corners[:, None], k.matrix, np.array(result.lens.distortion))
        u, v = camera.bend(np.asarray(np.moveaxis(rays, -1, 0)[..., 0], dtype=np.float64))
        off = np.stack([u * camera.fx + camera.cx, v * camera.fy + camera.cy], -1) - result.corners
        assert np.sqrt((off**2).sum(-1).mean()) < by
    assert found.pose is not None
    T = found.pose.T_color_depth
    assert np.linalg.norm(T[:3, 3] - T_COLOR_DEPTH[:3, 3]) < 1e-3 * by
    assert np.rad2deg(rotation_angle(T[:3, :3].T @ T_COLOR_DEPTH[:3, :3])) < 0.1 * by
    assert found.scale is not None
    assert abs(found.scale.scale - SCALE) < 1e-3 * by


def test_rendered_boards(result: CalibrationResult) -> None:
    require_truth(result, (SMALL_COLOR, SMALL_DEPTH), 2.5)
    assert result.pose is not None
    assert result.pose.pairs == 8
    assert result.pose.sigma is not None
    assert result.pose.sigma[0] < 1e-3


def test_its_files(result: CalibrationResult, tmp_path: Path) -> None:
    file, image = write_calibration(result, tmp_path / "new")
    assert [p.name for p in files_in(tmp_path / "new")] == ["calibration.json", "residuals.png"]
    again = read_calibration(file)
    assert (again.color, again.depth) == (result.calibration.color, result.calibration.depth)
    assert (again.depth_scale, again.digest) == (result.calibration.depth_scale, result.calibration.digest)
    shown = cv2.imread(str(image))
    assert shown is not None
    assert min(shown.shape[:2]) > 600
    told = "\n".join(result.lines)
    assert "true depth = 1.01" in told
    assert result.verdict in told
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="can't write"):
        write_calibration(result, tmp_path / "file")


def test_known_lenses_need_one_pair(boards: Path) -> None:
    known = replace(truth_of(SMALL_COLOR), depth=truth_of(SMALL_DEPTH).color)
    one = calibrate(
        [boards / "color" / "01.png"], CHARUCO, depth=[boards / "infrared" / "01.png"], known=known
    )
    assert one.pose is not None
    assert np.linalg.norm(one.pose.T_color_depth[:3, 3] - T_COLOR_DEPTH[:3, 3]) < 3e-3
    assert one.calibration.color == known.color
    assert one.verdict == "doubtful"
    assert any("1 pairs" in r for r in one.reasons)
    wide = replace(known, color=Lens(Intrinsics(800, 500, 600.0, 600.0, 400.0, 250.0)))
    with pytest.raises(InputError, match="480x360, its known lens is of 800x500"):
        calibrate([boards / "color" / "01.png"], CHARUCO, known=wide)


def truth_of(camera: Camera) -> Calibration:
    """The truth of a camera as a calibration."""
    k = Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return Calibration(Lens(k, camera.distortion), None, None, None)


def test_the_older_pattern_is_recognised(tmp_path: Path) -> None:
    small = Camera(400, 300, 305.0, 305.0, 200.0, 150.0, (0.0,) * 8)
    rays = small.rays()
    paths = []
    for k in range(3):
        image, _ = picture(
            rays,
            pose((0.2 * k, 0.1, 0.0), (-0.135, -0.09, 0.3)),
            texture(9, 6, "5X5_250", legacy=True),
            SQUARE,
            1.0,
            k,
        )
        paths.append(tmp_path / f"{k}.png")
        cv2.imwrite(str(paths[-1]), image)
    found = find_boards(paths, CHARUCO, "pictures")
    assert found.board.legacy
    assert len(found.usable) == 3
    assert not find_boards(paths, CHARUCO, "pictures", certain=True).usable


def test_checkerboard_and_sixteen_bits(tmp_path: Path) -> None:
    """A corner's number and place; dark 16-bit infrared."""
    small = Camera(400, 300, 305.0, 305.0, 200.0, 150.0, (0.0,) * 8)
    T = pose((0.2, 0.1, 0.0), (-0.135, -0.09, 0.35))
    image, _ = picture(small.rays(), T, texture(9, 6), SQUARE, 0.5, 1)
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), (image.astype(np.uint16) * 3 + 200))
    assert np.ptp(read_grey(path)) > 200
    (view,) = find_boards([path], CHECKER, "pictures").usable
    points = CHECKER.points @ T[:3, :3].T + T[:3, 3]
    truth = points[:, :2] / points[:, 2:] * 305.0 + [200.0, 150.0]
    ids = view.ids if np.abs(view.corners[0] - truth[0]).max() < 5 else len(truth) - 1 - view.ids
    assert np.abs(view.corners - truth[ids]).max() < 0.2


# Views without pictures: corners are projected by OpenCV's formula and jittered.


def views_of(
    count: int,
    tilt: float = 0.4,
    jitter: float = 0.05,
    at: float = 0.25,
    far: float = 0.25,
    bend: float = 0.0,
    seed: int = 5,
) -> Pictures:
    rng = np.random.default_rng(seed)
    board = CHARUCO
    views: list[View] = []
    points = board.points.copy()
    points[:, 2] = bend * np.sin(points[:, 0] / 0.05)  # of the printed board, unknown to who calibrates
    K = np.array([[COLOR.fx, 0, COLOR.cx], [0, COLOR.fy, COLOR.cy], [0, 0, 1.0]])
    while len(views) < count:
        k, z = len(views), rng.uniform(far, 2.0 * far)
        turn = rng.uniform(-tilt, tilt, 3)
        T = pose(tuple(turn), (0.0, 0.0, 0.0))
        T[:3, 3] = np.array([at * z * np.cos(2.4 * k), at * z * np.sin(2.4 * k), z]) - T[:3, :3] @ [
            4.5 * SQUARE,
            3 * SQUARE,
            0,
        ]
        corners = cv2.projectPoints(points, turn, T[:3, 3], K, np.array(COLOR.distortion))[0].reshape(-1, 2)
        inside = ((corners > 5) & (corners < [795, 595])).all(axis=1)
        views.append(
            View(f"{k}", np.flatnonzero(inside), (corners + rng.normal(0, jitter, corners.shape))[inside])
        )
    return Pictures((800, 600), tuple(v.name for v in views), tuple(views), board)


def of(pictures: Pictures) -> CameraResult:
    return calibrate_camera("colour", pictures)


def test_good_views_are_trusted() -> None:
    found = of(views_of(12))
    assert found.reasons == ()
    assert abs(found.lens.camera.fx / COLOR.fx - 1) < 3 * max(found.sigma_focal, 1e-4)
    assert found.left_out is not None
    assert 0.05 < found.rms < found.left_out < 0.1


@pytest.mark.parametrize(
    ("pictures", "told"),
    [
        (views_of(6), "6 pictures show the board, 8 are needed"),
        (views_of(10, at=0.0, far=0.5, seed=2), "of the picture, 50% are needed"),
        (views_of(10, tilt=0.02), "tilts differ by"),
        (views_of(10, jitter=2.0), "corners are off by"),
        (views_of(10, jitter=0.6), "the focal length is known to"),
    ],
)
def test_doubts_are_told(pictures: Pictures, told: str) -> None:
    assert any(told in r for r in of(pictures).reasons)


def test_the_number_of_coefficients_can_be_said() -> None:
    found = calibrate_camera("colour", views_of(12), coefficients=8)
    assert len(found.lens.distortion) == 8
    assert abs(found.lens.camera.fx / COLOR.fx - 1) < 3e-3


@pytest.mark.slow
def test_wrong_corners_do_not_matter() -> None:
    good = views_of(12)
    bad = []
    for k, v in enumerate(good.usable):
        corners = v.corners.copy()
        corners[k % len(corners)] += (25.0, -10.0)
        bad.append(View(v.name, v.ids, corners))
    spoilt = replace(good, views=tuple(bad))
    assert abs(of(spoilt).lens.camera.fx / COLOR.fx - 1) < 3e-3
    cleaned, lost = without_wrong_corners(spoilt)
    assert lost == 12
    found = of(cleaned)
    assert found.reasons == ()
    assert found.rms < 0.1
    assert without_wrong_corners(good)[1] == 0


def test_an_uneven_board_is_measured() -> None:
    """Nearer pictures count less, and the lens is nearer to the truth than without."""
    uneven = [views_of(14, bend=5e-4, jitter=0.03, seed=s) for s in range(4)]
    ours, plain = [], []
    for pictures in uneven:
        views, points = pictures.usable, pictures.board.points
        fit = fit_lens(views, points, pictures.size, Model(5, True))
        assert fit.unevenness > 2e-5
        ours.append(fit.matrix[0, 0] / COLOR.fx - 1)
        objects = [points[v.ids].astype(np.float32) for v in views]
        corners = [v.corners.astype(np.float32)[:, None] for v in views]
        K = cv2.calibrateCamera(objects, corners, pictures.size, None, None)[1]
        plain.append(K[0, 0] / COLOR.fx - 1)
    assert np.sqrt(np.mean(np.square(ours))) < 1.05 * np.sqrt(np.mean(np.square(plain)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["charuco", "legacy", "checkerboard"])
def test_rendered_boards_at_full_size(tmp_path: Path, kind: str) -> None:
    """Both cameras count corners from the same end, whatever the board."""
    plain = kind == "checkerboard"
    drawn = texture(9, 6) if plain else texture(9, 6, "5X5_250", legacy=kind == "legacy")
    out = write_boards(tmp_path / kind, drawn, SQUARE, T_COLOR_DEPTH, 12, SCALE)
    found = calibrated(out, CHECKER if plain else CHARUCO)
    require_truth(found, (COLOR, DEPTH), 1.0)
    assert found.verdict == "trusted", found.reasons
    assert found.board.legacy == (kind == "legacy")
