"""The page: complete in itself, made from whatever is there, and true to the twin."""

from __future__ import annotations

import dataclasses
import re
import warnings
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.viewer import SIZE
from twin import geometry as geo
from twin import report
from twin.errors import InputError
from twin.page import page, render
from twin.page.drawn import drawn_once
from twin.page.viewer import three_js
from twin.report import frames, meshes, plots, sections, views
from twin.runs.stages import Run
from twin.scene import HAND_LABEL, Recorded, Trajectory, Twin
from twin.storage import save

K = np.array([[100.0, 0, 79.5], [0, 100.0, 59.5], [0, 0, 1]])


class Outside(HTMLParser):
    """Collects what a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.pictures = 0

    def handle_starttag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href", "poster", "srcset", "data") and value:
                self.pictures += value.startswith("data:image")
                self.found += [] if value.startswith("data:") else [value]


def seen(twin: Twin, count: int = 12) -> Twin:
    """The twin with a camera that stands before it, and labels: the left half is part 2, a corner is the
    hand."""
    vertices = np.concatenate([p.mesh.vertices for p in twin.parts])
    centre = (vertices.min(0) + vertices.max(0)) / 2
    contact = twin.parts[0].contact
    assert contact is not None
    eye = centre + 2.0 * contact.rotation[:, 2] + [0, 0, 0.3]
    pose = views.look_at(eye, centre, vertices, *SIZE[::-1]).T_world_cam
    label = np.ones(SIZE, dtype=np.uint8)
    label[:, : SIZE[1] // 2] = 2
    label[:20, :20] = HAND_LABEL
    indices = np.arange(0, 5 * count, 5)
    cameras = Trajectory(indices, indices / 15.0, np.repeat(pose[None], count, 0))
    labels = {int(k): label for k in indices}
    return dataclasses.replace(twin, cameras=cameras, labels=labels, recorded=Recorded("rec", 60, "f" * 64))


@pytest.fixture(scope="module")
def twin() -> Twin:
    return seen(cabinet_twin())


@pytest.fixture(scope="module")
def finished(twin: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("run")
    with Run(run, "f" * 64, config={"labels": {"window": 3}}) as stages:
        stages.warn("no <time> stamps")
        stages.stage("tracks", 1, None, [], lambda: 1)
    save(twin, run / "twin")
    image = np.full((*SIZE, 3), 128, dtype=np.uint8)
    report.save_key_frames(run, dict.fromkeys(report.pick_key_frames(twin), image), K)
    table = report.Table("urdf", ["what", "result"], [["axis", "ok"], ["<mass>", "FAILED"]])
    report.save_section(run, report.Section("check", False, 1.5, [table], ["a collider is missing"]))
    render(run)
    return run


def test_page_is_complete_in_itself(finished: Path, twin: Twin) -> None:
    text = (finished / "report.html").read_text(encoding="utf-8")
    text = text.replace(three_js(), "")  # names addresses in its messages
    outside = Outside()
    outside.feed(text)
    assert outside.found == []
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", text)
    assert outside.pictures >= 6 + page.STEPS + 1 + len(
        twin.parts
    )  # key frames, closed, open, overview, plots


def test_page_tells_what_the_run_holds(finished: Path, twin: Twin) -> None:
    text = (finished / "report.html").read_text(encoding="utf-8")
    for part in twin.parts:
        assert part.name in text
    for words in (
        "no &lt;time&gt; stamps",
        "a collider is missing",
        "&lt;mass&gt;",
        'class="bad">FAILED',
        "window = 3",
        "tracks",
    ):
        assert words in text
    assert "earlier twin" not in text


def test_a_warning_of_a_window_tells_its_frames(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as stages:
        stages.stage(
            "motion", 1, None, [], lambda: warnings.warn("a hand", stacklevel=1), item="000173-000276"
        )
    assert "<b>motion, frames 173 to 276</b>: a hand" in _rendered(tmp_path)


def test_of_a_window_that_was_solved_again_the_report_tells_the_second_time(tmp_path: Path) -> None:
    with Run(tmp_path, "x") as stages:
        for name, item, text in (
            ("motion", "000173-000276", "no part was found"),
            ("refine", "000173-000276-again", "no rest"),
            ("labels", "000173-000276-again", "no rest"),
        ):
            stages.stage(name, 1, None, [], lambda text=text: warnings.warn(text, stacklevel=1), item=item)
    page = _rendered(tmp_path)
    assert "no part was found" not in page
    assert page.count("no rest") == 1
    assert "<b>refine, frames 173 to 276</b>: no rest" in page


def test_results_of_an_earlier_twin_are_marked(
    finished: Path, twin: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "_pictures", lambda _: {"opening": [], "dollhouse": "", "plan": ""})
    section = sections.load_section(finished, "check")
    assert section is not None
    report.save_section(tmp_path, section)
    save(twin, tmp_path / "twin")
    assert "earlier twin" not in _rendered(tmp_path)  # made before there was any
    report.save_section(tmp_path, section)
    bare = dataclasses.replace(twin, static=dataclasses.replace(twin.static, collision=()))
    save(bare, tmp_path / "twin")
    assert "earlier twin" not in _rendered(tmp_path)  # collision shapes are no part of the twin's identity
    save(dataclasses.replace(twin, name="other"), tmp_path / "twin")
    assert "earlier twin" in _rendered(tmp_path)


def test_unfinished_and_bare_runs_have_a_page(twin: Twin, tmp_path: Path) -> None:
    for name in ("empty", "stages", "twin"):
        (tmp_path / name).mkdir()
    with Run(tmp_path / "stages", "x") as stages:
        stages.stage("tracks", 1, None, [], lambda: 1)
    save(dataclasses.replace(twin, cameras=None, labels={}, recorded=None), tmp_path / "twin" / "twin")
    assert "not finished yet" in _rendered(tmp_path / "empty")
    assert "tracks" in _rendered(tmp_path / "stages")
    assert "not finished yet" not in _rendered(tmp_path / "twin")


def test_a_twin_without_parts_or_surfaces_has_a_page(tmp_path: Path) -> None:
    from twin.scene import Mesh, StaticPart

    nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    save(Twin("bare", StaticPart("static", nothing), ()), tmp_path / "twin")
    assert "bare" in _rendered(tmp_path)


def test_pictures_are_drawn_again_when_what_they_show_changes_and_only_then(
    twin: Twin, tmp_path: Path
) -> None:
    drawn: list[Twin] = []

    def draw(shown: Twin) -> dict[str, list[int]]:
        drawn.append(shown)
        return {"opening": [len(drawn)]}

    def times_drawn(shown: Twin) -> list[int]:
        return list(drawn_once(tmp_path, shown, draw)["opening"])

    part = twin.parts[0]
    opened = dataclasses.replace(part.joint, upper=part.joint.upper + 0.01)
    moved = part.mesh.transformed(geo.make_pose(translation=np.array([0.0, 0.0, 1e-9])))
    assert times_drawn(twin) == times_drawn(dataclasses.replace(twin, name="other")) == [1]
    assert times_drawn(dataclasses.replace(twin, static=dataclasses.replace(twin.static, collision=()))) == [
        1
    ]
    for k, changed in enumerate(
        (dataclasses.replace(part, joint=opened), dataclasses.replace(part, mesh=moved)), 2
    ):
        assert times_drawn(dataclasses.replace(twin, parts=(changed, *twin.parts[1:]))) == [k]
    assert times_drawn(twin) == times_drawn(twin) == [4]
    kept = tmp_path / "report" / "pictures.json"
    kept.write_text(re.sub(r"\b4\b", "9", kept.read_text()))
    assert times_drawn(twin) == [5]
    kept.write_text("[]")
    assert times_drawn(twin) == [6]


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a run folder"):
        render(tmp_path / "nowhere")


def test_key_frames_cover_rest_and_motion(twin: Twin) -> None:
    picked = report.pick_key_frames(twin)
    posed = [int(f) for f in twin.cameras.frames] if twin.cameras else []
    assert set(picked) <= set(posed)
    assert {posed[0], posed[-1]} <= set(picked)
    first, last = twin.parts[0].motion.intervals[0]
    assert sum(first <= k <= last for k in picked) >= 3


def test_axis_is_drawn_where_it_projects(twin: Twin) -> None:
    """Red pixels lie on the line between the projected end points, and nowhere far from it."""
    twin = dataclasses.replace(twin, parts=twin.parts[:1], labels={})
    image = frames.draw_frame(np.zeros((480, 640, 3), np.uint8), twin, 0, K * [[4], [4], [1]])
    y, x = np.nonzero((image == frames.AXIS_COLOR).all(-1))
    assert len(x) > 50
    pose = twin.cameras.pose(0) if twin.cameras else None
    assert pose is not None
    ends = geo.transform(geo.invert_pose(pose), frames.axis_line(twin.parts[0]))
    a, b = (ends @ (K * [[4], [4], [1]]).T / ends[:, 2:])[:, :2]
    along = (b - a) / np.linalg.norm(b - a)
    offset = np.stack([x, y], 1) - a
    across = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
    assert np.median(across) < 4
    assert across.max() < 0.15 * np.linalg.norm(b - a) + 4  # the arrow's head


def test_labels_tint_their_pixels_only(twin: Twin) -> None:
    bare = dataclasses.replace(twin, cameras=None)
    image = frames.draw_frame(np.full((*SIZE, 3), 100, np.uint8), bare, 0, K)
    assert (image[:, SIZE[1] // 2 + 2 :] == 100).all()
    part, hand = np.array(frames.PART_COLORS[0]), np.array(frames.HAND_COLOR)
    np.testing.assert_allclose(image[60, 30], 0.55 * 100 + 0.45 * part, atol=1)
    np.testing.assert_allclose(image[8, 8], 0.55 * 100 + 0.45 * hand, atol=1)


def test_lines_behind_the_camera_are_cut() -> None:
    image = np.zeros((*SIZE, 3), np.uint8)
    frames.draw_polyline(image, np.array([[0, 0, -2.0], [0, 0, -1.0]]), np.eye(4), K, (255, 0, 0))
    assert not image.any()
    frames.draw_polyline(image, np.array([[0.1, 0, -2.0], [0.1, 0, 2.0]]), np.eye(4), K, (255, 0, 0))
    assert image[:, SIZE[1] // 2 :].any()
    assert not image[:, : SIZE[1] // 2 - 2].any()


def test_opening_moves_the_part_alone(twin: Twin) -> None:
    closed, half, opened = meshes.opening(twin, 3, 160, 120)
    assert closed.shape == (120, 160, 3)
    assert (closed != opened).any(-1).mean() > 0.02
    assert (closed != half).any()
    assert (closed[:3] == opened[:3]).all()  # far from the part


def test_rendered_surface_lies_where_it_projects() -> None:
    """A red square, seen head-on from 2 m, fills the pixels that its corners project to."""
    from twin.scene import Mesh, StaticPart

    corners = np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]])
    square = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.full((4, 3), (200, 0, 0), np.uint8))
    view = views.look_at(np.array([0, -2.0, 0]), np.zeros(3), corners, 200, 150)
    layer = meshes._Caster([(square, (0, 0, 0), 0.0)]).cast(view.rays())
    hit = np.isfinite(layer.distance)
    side = 1.0 / 2.0 * view.matrix[0, 0]
    assert hit.sum() == pytest.approx(side**2, rel=0.03)
    assert layer.distance[75, 100] == pytest.approx(2.0, abs=1e-3)
    np.testing.assert_allclose(layer.color[75, 100], [200, 0, 0], atol=1)
    assert StaticPart("s", square).mesh is square


def test_surfaces_seen_from_behind_are_seen_through() -> None:
    from twin.scene import Mesh

    corners = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    away = Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]]), np.full((4, 3), 250, np.uint8))
    facing = Mesh(
        corners + [0, 1, 0], np.array([[0, 1, 2], [0, 2, 3]]), np.full((4, 3), (0, 250, 0), np.uint8)
    )
    view = views.look_at(np.array([0, -3.0, 0]), np.zeros(3), corners, 80, 60)
    caster = meshes._Caster([(away, (0, 0, 0), 0.0), (facing, (0, 0, 0), 0.0)])
    assert caster.cast(view.rays()).distance[30, 40] == pytest.approx(3.0, abs=1e-3)
    through = caster.cast(view.rays(), cull=True)
    assert through.distance[30, 40] == pytest.approx(4.0, abs=2e-3)
    assert through.color[30, 40, 0] == 0


def test_facts_are_in_degrees_and_millimetres(twin: Twin) -> None:
    for part in twin.parts:
        facts = {name: value for name, value, _ in page.part_facts(part)}
        factor, unit = (np.degrees(1), "°") if part.joint.kind == "revolute" else (1000.0, "mm")
        assert facts["range"] == f"0.0 to {part.joint.upper * factor:.1f} {unit}"
        assert ("pivot" in facts) == (part.joint.kind == "revolute")


def test_state_plot_is_the_same_every_time(twin: Twin) -> None:
    def plain(svg: str) -> str:
        return re.sub(r'(id|href)="[^"]*"|url\(#[^)]*\)', "", svg)

    assert plain(plots.state_plot(twin.parts[0])) == plain(plots.state_plot(twin.parts[0]))


def test_film_pictures_span_the_film(tmp_path: Path) -> None:
    import av

    path = tmp_path / "replay.mp4"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("h264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for k in range(30):
            image = np.full((48, 64, 3), 8 * k, np.uint8)
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                film.mux(packet)
        for packet in stream.encode():
            film.mux(packet)
    pictures = plots.film_pictures(path, count=4, width=32)
    brightness = [float(p.mean()) for p in pictures]
    assert [p.shape for p in pictures] == [(24, 32, 3)] * 4
    assert brightness == sorted(brightness)
    assert brightness[0] < 20
    assert brightness[-1] > 180


def test_a_broken_film_is_named(tmp_path: Path) -> None:
    (tmp_path / "replay.mp4").write_bytes(b"not a film")
    with pytest.raises(InputError, match=r"replay\.mp4"):
        plots.film_pictures(tmp_path / "replay.mp4")


def _rendered(run: Path) -> str:
    return render(run).read_text(encoding="utf-8")
