"""Key frames: plain pictures kept by the reconstruction, with labels, axis and contact drawn over."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.files.atomic import write_file
from twin.files.paths import AnyPath
from twin.files.text import read_json, write_json
from twin.geometry import Array
from twin.scene import HAND_LABEL, Part, Revolute, Twin

Image = NDArray[np.uint8]

# RGB. Parts take turns; the hand, the axis and the contact keep theirs.
PART_COLORS = ((47, 111, 222), (33, 158, 96), (140, 82, 200), (0, 150, 170), (190, 120, 30))
HAND_COLOR = (240, 140, 46)
AXIS_COLOR = (226, 30, 90)
CONTACT_COLOR = (255, 221, 51)
_NEAR = 0.05  # m, what lies closer to the camera is not drawn


def part_color(part: Part) -> tuple[int, int, int]:
    """RGB of a part in every picture of the page."""
    return PART_COLORS[(part.id - 2) % len(PART_COLORS)]


def pick_key_frames(twin: Twin, count: int = 6) -> list[int]:
    """Recording frames that tell the story: first and last, and evenly spread over each motion.

    Only frames with a label image and a camera pose are taken when there are such.
    """
    posed = {int(f) for f in twin.cameras.frames} if twin.cameras is not None else set()
    usable = sorted(posed & set(twin.labels)) or sorted(twin.labels) or sorted(posed)
    if not usable:
        return []
    intervals = sorted({i for p in twin.parts for i in p.motion.intervals})
    wanted: list[float] = [usable[0], usable[-1]]
    for first, last in intervals:
        wanted += list(np.linspace(first, last, max(3, (count - 2) // len(intervals))))
    if not intervals:
        wanted += list(np.linspace(usable[0], usable[-1], count))
    return sorted({min(usable, key=lambda f, w=w: abs(f - w)) for w in wanted})  # type: ignore[misc]


def save_key_frames(run: AnyPath, frames: Mapping[int, Image], camera_matrix: Array) -> None:
    """Write RUN/report/frame_NNNNNN.jpg and frames.json.

    Args:
        run: the run folder.
        frames: recording frame -> colour image (H, W, 3) uint8 RGB.
        camera_matrix: K (3, 3) in pixels of these images.
    """
    import cv2

    folder = Path(run) / "report"
    folder.mkdir(parents=True, exist_ok=True)
    before = read_json(folder / "frames.json").get("frames", [])
    for index, image in frames.items():
        _, jpeg = cv2.imencode(".jpg", image[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
        write_file(folder / f"frame_{index:06d}.jpg", jpeg.tobytes())
    write_json(
        folder / "frames.json",
        {"frames": sorted(frames), "camera_matrix": np.asarray(camera_matrix).tolist()},
    )
    for old in set(before) - set(frames):
        (folder / f"frame_{old:06d}.jpg").unlink(missing_ok=True)


def drawn_key_frames(run: Path, twin: Twin) -> list[tuple[int, Image]]:
    """Key frames of the run, with labels, joint axes and contacts drawn in. Empty when none were kept."""
    import cv2

    index = read_json(run / "report" / "frames.json")
    drawn = []
    for frame in index.get("frames", []):
        bgr = cv2.imread(str(run / "report" / f"frame_{frame:06d}.jpg"), cv2.IMREAD_COLOR)
        if bgr is not None:
            image = np.ascontiguousarray(bgr[:, :, ::-1], dtype=np.uint8)
            drawn.append((frame, draw_frame(image, twin, frame, np.array(index["camera_matrix"]))))
    return drawn


def draw_frame(image: Image, twin: Twin, frame: int, camera_matrix: Array) -> Image:
    """The colour image (H, W, 3) with everything the twin knows about this recording frame drawn over it."""
    out = image.copy()
    if frame in twin.labels:
        out = _tint_labels(out, twin.labels[frame], twin)
    pose = twin.cameras.pose(frame) if twin.cameras is not None else None
    if pose is None:
        return out
    T_cam_world = geo.invert_pose(pose)
    states = {p.id: _state(p, frame) for p in twin.parts}
    for part in twin.parts:
        T_world_mount = np.eye(4) if part.parent is None else twin.part_pose(part.parent, states)
        draw_polyline(
            out,
            geo.transform(T_world_mount, axis_line(part)),
            T_cam_world,
            camera_matrix,
            AXIS_COLOR,
            arrow=True,
        )
        if part.contact is not None:
            point = geo.transform(twin.part_pose(part.id, states), part.contact.point[None])
            draw_point(out, point, T_cam_world, camera_matrix, CONTACT_COLOR)
    return out


def axis_line(part: Part) -> Array:
    """End points (2, 3) of the drawn axis: along the hinge, or the way a drawer goes from its middle."""
    joint, vertices = part.joint, part.mesh.vertices
    if isinstance(joint, Revolute):
        along = (vertices - joint.pivot) @ joint.axis if len(vertices) else np.zeros(1)
        margin = 0.15 * max(float(np.ptp(along)), 0.1)
        ends = np.array([along.min() - margin, along.max() + margin])
        return joint.pivot + ends[:, None] * joint.axis
    start = part.contact.point if part.contact is not None else part.mesh.area_centroid
    return start + np.array([[0.0], [max(joint.upper, 0.05)]]) * joint.axis


def draw_polyline(
    image: Image,
    points: Array,
    T_cam_world: Array,
    camera_matrix: Array,
    color: tuple[int, int, int],
    *,
    arrow: bool = False,
    width: int = 0,
) -> None:
    """Draw world points (n, 3) joined by lines into `image`, in place; behind the camera is cut off."""
    import cv2

    width = width or max(2, image.shape[1] // 260)
    cam = geo.transform(T_cam_world, points)
    for k, (a, b) in enumerate(pairwise(cam)):
        segment = _clip(a, b)
        if segment is None:
            continue
        p, q = (_pixel(s, camera_matrix) for s in segment)
        last = arrow and k == len(cam) - 2
        if last:
            cv2.arrowedLine(image, p, q, (255, 255, 255), width + 2, cv2.LINE_AA, tipLength=0.12)
            cv2.arrowedLine(image, p, q, color, width, cv2.LINE_AA, tipLength=0.12)
        else:
            cv2.line(image, p, q, color, width, cv2.LINE_AA)


def draw_point(
    image: Image, point: Array, T_cam_world: Array, camera_matrix: Array, color: tuple[int, int, int]
) -> None:
    """Draw one world point (1, 3) as a disc with a dark rim, in place."""
    import cv2

    cam = geo.transform(T_cam_world, point)[0]
    if cam[2] > _NEAR:
        centre, radius = _pixel(cam, camera_matrix), max(4, image.shape[1] // 110)
        cv2.circle(image, centre, radius + 1, (30, 30, 30), -1, cv2.LINE_AA)
        cv2.circle(image, centre, radius - 1, color, -1, cv2.LINE_AA)


def _tint_labels(image: Image, labels: Image, twin: Twin) -> Image:
    import cv2

    if labels.shape != image.shape[:2]:
        labels = cv2.resize(labels, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_NEAREST)  # type: ignore[assignment]
    colors = {p.id: part_color(p) for p in twin.parts} | {HAND_LABEL: HAND_COLOR}
    for label, color in colors.items():
        mask = labels == label
        if not mask.any():
            continue
        image[mask] = (0.55 * image[mask] + 0.45 * np.array(color)).astype(np.uint8)
        edges, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(image, edges, -1, color, max(1, image.shape[1] // 500), cv2.LINE_AA)
    return image


def _state(part: Part, frame: int) -> float:
    """The measured state at the nearest frame that has one; a picture needs no more."""
    m = part.motion
    return float(m.state[np.abs(m.frames - frame).argmin()]) if len(m.frames) else 0.0


def _clip(a: Array, b: Array) -> tuple[Array, Array] | None:
    """The piece of a segment in camera coordinates that lies in front of the camera."""
    if max(a[2], b[2]) <= _NEAR:
        return None
    if min(a[2], b[2]) >= _NEAR:
        return a, b
    cut = a + (b - a) * (_NEAR - a[2]) / (b[2] - a[2])
    return (cut, b) if a[2] < _NEAR else (a, cut)


def _pixel(cam: Array, camera_matrix: Array) -> tuple[int, int]:
    """Nearest pixel (x, y), kept within what drawing functions can hold."""
    uv: Any = (camera_matrix @ cam)[:2] / cam[2]
    x, y = np.clip(uv, -20000, 20000).round().astype(int)
    return int(x), int(y)
