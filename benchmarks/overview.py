"""Draw docs/overview.png and docs/film.gif, which the README and docs/first_twin.md show, from a finished
run; from that of a walk docs/room.png.

usage: python benchmarks/overview.py RUN [FOLDER]
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from twin.completion import without_shapes
from twin.report.frames import Image, drawn_key_frames
from twin.report.meshes import opening, plan
from twin.report.plots import film_pictures
from twin.report.timeline import timeline
from twin.scene import Twin
from twin.storage import load

PANEL = (480, 360)
ROOM_PARTS = 4
FILM_WIDTH, FILM_RATE = 720, 8  # px, frames in a second: the film stays below 3 MB
_FILM_COLOURS = 256
_FROM = (62.0, -24.0, 1.9)  # azimuth and elevation (deg) and distance (m) of the twin's pictures


def panels(run: Path) -> list[tuple[str, Image]]:
    """Captions and pictures: what was recorded, what was found, the exported twin closed and open, the
    robot."""
    twin = load(run)
    drawn = drawn_key_frames(run, twin)
    first, last = twin.parts[0].motion.intervals[0]
    frame, found = min(drawn, key=lambda d: abs(d[0] - (0.4 * first + 0.6 * last)))
    recorded = cv2.imread(str(run / "report" / f"frame_{frame:06d}.jpg"))
    closed, opened = (_exported(run / "export" / "mjcf" / "scene.xml", key) for key in ("closed", "open"))
    film = film_pictures(sorted((run / "replay").glob("*/*/replay.mp4"))[0], count=7, width=2 * PANEL[0])
    return [
        ("a recording", np.asarray(recorded[:, :, ::-1], dtype=np.uint8)),
        ("part, hand, joint", found),
        ("its twin, closed", closed),
        ("and open", opened),
        ("opened by a robot", film[4][: PANEL[1], PANEL[0] :]),  # beside the recording, above its words
    ]


def _exported(scene: Path, key: str) -> Image:
    """What MuJoCo shows of an exported scene at a keyframe."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = model.stat.center
    camera.azimuth, camera.elevation, camera.distance = _FROM
    with mujoco.Renderer(model, height=PANEL[1], width=PANEL[0]) as renderer:
        renderer.update_scene(data, camera)
        return np.asarray(renderer.render(), dtype=np.uint8)


def draw(run: Path, path: Path) -> None:
    """Write the panels side by side."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = panels(run)
    figure = Figure(figsize=(3.2 * len(shown), 2.75), layout="constrained", facecolor="white")
    axes: Any = figure.subplots(1, len(shown))
    for k, (ax, (caption, image)) in enumerate(zip(axes, shown, strict=True)):
        ax.imshow(_fitted(image))
        ax.set_axis_off()
        ax.set_title(("→  " if k in (1, 2, 4) else "") + caption, fontsize=13)
    FigureCanvasAgg(figure).print_png(path)


def draw_room(twin: Twin, path: Path) -> None:
    """Write the map of a room, and up to four of its parts closed and open as they were handled."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    twin = without_shapes(twin)  # as it was seen
    shown = sorted(twin.parts, key=lambda p: p.motion.intervals[:1])[:ROOM_PARTS]
    figure = Figure(figsize=(13.0, 4.3), layout="compressed", facecolor="white")
    axes: dict[str, Any] = figure.subplot_mosaic(
        [["map", *(f"{p.id} {k}" for p in shown)] for k in range(2)], width_ratios=[2.6, *(1 for _ in shown)]
    )
    axes["map"].imshow(plan(twin, 960, 720))
    axes["map"].set_title("the room from above, with the way that the person walked", fontsize=12)
    for part in shown:
        for k, image in enumerate(opening(twin, 2, *PANEL, only=part)):
            axes[f"{part.id} {k}"].imshow(image)
        axes[f"{part.id} 0"].set_title(part.name, fontsize=12)
    for ax in axes.values():
        ax.set_axis_off()
    FigureCanvasAgg(figure).print_png(path)


def draw_film(run: Path, path: Path) -> None:
    """Write the robot's film beside the person's as an animation that repeats."""
    import av
    from PIL import Image as Picture

    with av.open(str(sorted((run / "replay").glob("*/*/replay.mp4"))[0])) as film:
        rate = film.streams.video[0].average_rate
        step = round(float(rate or FILM_RATE) / FILM_RATE)
        shown = [f.to_image() for k, f in enumerate(film.decode(video=0)) if k % step == 0]
    size = (FILM_WIDTH, round(shown[0].height * FILM_WIDTH / shown[0].width))
    small = [f.resize(size, Picture.Resampling.LANCZOS) for f in shown]
    palette = small[len(small) // 2].quantize(_FILM_COLOURS)
    frames = [f.quantize(palette=palette, dither=Picture.Dither.NONE) for f in small]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000 // FILM_RATE, loop=0)


def _fitted(image: Image) -> Image:
    """Cut to the panels' aspect around the middle, and scale to their size."""
    height, width = image.shape[:2]
    w = min(width, height * PANEL[0] // PANEL[1])
    h = min(height, width * PANEL[1] // PANEL[0])
    y, x = (height - h) // 2, (width - w) // 2
    return np.asarray(
        cv2.resize(image[y : y + h, x : x + w], PANEL, interpolation=cv2.INTER_AREA), dtype=np.uint8
    )


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python benchmarks/overview.py RUN [FOLDER]")
    os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it once, when it is first imported
    place = Path(sys.argv[2] if len(sys.argv) == 3 else "docs")
    if timeline(found := load(Path(sys.argv[1]))):
        draw_room(found, place / "room.png")
    else:
        draw(Path(sys.argv[1]), place / "overview.png")
        draw_film(Path(sys.argv[1]), place / "film.gif")
