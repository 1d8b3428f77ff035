"""The scene of the page in a real browser, beside MuJoCo's picture of the export, and what it is made of."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh
from scipy import ndimage

import twin as tw
from benchmarks.scenes.boards import cabinet_twin
from tests.makers.browser import Tab, browser
from tests.twin.page.test_page import SIZE, seen
from twin import report
from twin.completion.asset import AssetView
from twin.contacts import distance_to
from twin.errors import InputError, SceneError
from twin.exporters import export
from twin.geometry import Array
from twin.page import render, viewer
from twin.report.views import part_view
from twin.scene import Joint, Twin
from twin.storage import save
from twin.verdict import Reason, Verdict

HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
VIEW = (480, 360)


@pytest.fixture(scope="module")
def twin() -> Twin:
    """A cabinet whose camera saw it, with a reason that holds markup."""
    cabinet = seen(cabinet_twin(), count=60)
    assert cabinet.cameras is not None
    n = len(cabinet.cameras.frames)
    cameras = replace(cabinet.cameras, frames=np.arange(n), times=7.0 + np.arange(n) / 15.0)
    labels = {k: cabinet.labels[5 * k] for k in range(0, n, 4)}
    part = cabinet.parts[0]
    doubted = Verdict((Reason("NoRange", HOSTILE, {}, HOSTILE, "open it wider", "doubtful"),))
    motions = [replace(p.motion, times=7.0 + p.motion.frames / 15.0) for p in cabinet.parts]
    parts = [replace(p, motion=m) for p, m in zip(cabinet.parts, motions, strict=True)]
    parts[0] = replace(parts[0], verdict=doubted, limits_source=HOSTILE)
    assert part.joint.upper > 1
    return replace(cabinet, cameras=cameras, labels=labels, parts=tuple(parts))


def pictured(frame: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """A frame that tells its number: its grey is four times it."""
    return np.full((*SIZE, 3), 4 * frame, np.uint8)


@pytest.fixture(scope="module")
def page(twin: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("run")
    save(twin, run / "twin")
    report.save_film(run, report.film_frames(twin), pictured)
    return render(run)


@pytest.fixture(scope="module")
def tab(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with browser(tmp_path_factory.mktemp("profile")) as tab:
        tab.size(1400, 1000)
        tab.open(page.as_uri())
        assert tab.run("funtwin.ready") is True
        yield tab


def slide(tab: Tab, part: str, state: float, scale: float) -> None:
    """Move a slider as a hand does: the value, then the event."""
    tab.run(
        f"(() => {{const i = document.querySelector('.joint[data-part={part}] input');"
        f" i.value = {state * scale}; i.dispatchEvent(new Event('input'));}})()"
    )


def settled(tab: Tab) -> None:
    """Wait until all that was asked for is on the screen, with all pixels, however slow the machine is."""
    tab.run("funtwin.still()")


def test_the_page_asks_for_nothing_and_complains_of_nothing(tab: Tab, page: Path) -> None:
    own = page.as_uri()
    assert [a for a in tab.asked if a != own and not a.startswith(("data:", "blob:null/"))] == []
    assert tab.complaints == []
    assert tab.run("typeof window.hacked") == "undefined"
    assert HOSTILE in tab.run("document.querySelector('.joint[data-part=door] .reasons').textContent")


def silhouette_of_mujoco(
    twin: Twin, folder: Path, part: str, state: float, T_world_cam: Array, fov: float
) -> Array:
    """Pixels (H, W) that show the part, of MuJoCo's own picture of the exported MJCF from this camera."""
    path = export(twin, folder, "mjcf", view=AssetView("seen", "keep", "camera"))["mjcf"]
    spec = mujoco.MjSpec.from_file(str(path))
    T = T_world_cam.copy()
    T[:3, 1:3] *= -1  # OpenCV's camera axes in OpenGL's
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(T[:3, :3]).ravel())
    spec.worldbody.add_camera(name="eye", pos=T[:3, 3], quat=q, fovy=fov)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = VIEW
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[model.joint(f"{part}_joint").qposadr] = state
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, VIEW[1], VIEW[0]) as renderer:
        renderer.enable_segmentation_rendering()
        option = mujoco.MjvOption()
        option.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        renderer.update_scene(data, "eye", option)
        geoms = renderer.render()[:, :, 0]
    body = model.body(part).id
    return np.isin(geoms, np.flatnonzero(model.geom_bodyid == body))


def silhouette_of_page(tab: Tab, part: str, T_world_cam: Array, fov: float) -> Array:
    """Pixels (H, W) of the page's scene, drawn at this size, that change where the part is hidden."""
    eye, forward = T_world_cam[:3, 3], T_world_cam[:3, 2]
    tab.run(
        f"funtwin.renderer.setPixelRatio(1); funtwin.renderer.setSize({VIEW[0]}, {VIEW[1]}, false);"
        f"funtwin.camera.aspect = {VIEW[0] / VIEW[1]};"
        f"funtwin.orbit.look({eye.tolist()}, {(eye + forward).tolist()}, {fov});"
        "funtwin.scene.show('axes', false)"
    )
    pixels = []
    for shown in ("true", "false"):
        # in flat colours of its own, so that no shade is taken for the background's
        data = tab.run(
            f"(() => {{const link = funtwin.scene.links.get('{part}');"
            " const flat = new THREE.MeshBasicMaterial({color: 0xff00ff, side: THREE.DoubleSide});"
            " const kept = []; link.traverse((n) => {if (n.isMesh) {kept.push([n, n.material]); n.material = flat;}});"
            f" link.visible = {shown}; funtwin.draw(); link.visible = true;"
            " kept.forEach(([n, m]) => {n.material = m;});"
            f" const gl = funtwin.renderer.getContext(); const out = new Uint8Array(4 * {VIEW[0]} * {VIEW[1]});"
            f" gl.readPixels(0, 0, {VIEW[0]}, {VIEW[1]}, gl.RGBA, gl.UNSIGNED_BYTE, out);"
            " let text = ''; for (let k = 0; k < out.length; k += 4) text += String.fromCharCode(32 + (out[k] >> 3),"
            " 32 + (out[k + 1] >> 3)); return text;})()"
        )
        pixels.append(
            np.frombuffer(data.encode("latin1"), np.uint8).reshape(VIEW[1], VIEW[0], 2)[::-1].astype(int)
        )
    tab.run("funtwin.scene.show('axes', true); funtwin.resize(); funtwin.changed()")
    return np.abs(pixels[0] - pixels[1]).max(axis=-1) > 2


def apart(a: Array, b: Array) -> float:
    """Px by which the farthest pixel of either silhouette's rim lies off the other's."""
    rims = [m & ~ndimage.binary_erosion(m) for m in (a, b)]
    distance = [ndimage.distance_transform_edt(~r) for r in rims]
    return max(float(distance[1][rims[0]].max()), float(distance[0][rims[1]].max()))


@pytest.mark.parametrize(("part", "share"), [("door", 0.0), ("door", 0.7), ("drawer", 1.0)])
def test_a_slider_moves_the_part_as_the_joint_says(
    tab: Tab, twin: Twin, tmp_path: Path, part: str, share: float
) -> None:
    joint: Joint = twin.part(part).joint
    state = joint.lower + share * (joint.upper - joint.lower)
    view = part_view(twin, twin.parts, *VIEW)
    fov = float(np.rad2deg(2 * np.arctan(np.tan(view.fov / 2) * VIEW[1] / VIEW[0])))
    T = upright(view.T_world_cam)
    slide(
        tab,
        part,
        state,
        viewer.scene_document(tmp_path, twin)["parts"][[p.name for p in twin.parts].index(part)]["scale"],
    )
    mine = silhouette_of_page(tab, part, T, fov)
    theirs = silhouette_of_mujoco(twin, tmp_path, part, state, T, fov)
    assert mine.sum() > 2000
    assert apart(mine, theirs) <= 3.0
    slide(tab, part, 0.0, 1.0)


def upright(T_world_cam: Array) -> Array:
    """The camera that looks the same way with z up, as the page's does."""
    forward = T_world_cam[:3, 2]
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = T_world_cam.copy()
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    return T


def test_time_and_picture_and_states_agree(tab: Tab, twin: Twin) -> None:
    """The picture's grey tells its frame; states are those that the twin has there."""
    for labels, wanted in (("true", 2.53), ("false", 2.53), ("false", 0.0), ("true", 99.0)):
        tab.run(
            f"(() => {{const box = document.querySelector('#film input'); box.checked = {labels};"
            f" box.dispatchEvent(new Event('change')); funtwin.clock.go({wanted});}})()"
        )
        tab.run("document.querySelector('#film .picture').decode()")
        settled(tab)
        time = tab.run("funtwin.clock.time")
        frame = round(15 * time)
        told = tab.run("document.querySelector('#film figcaption span').textContent")
        assert told.startswith(f"frame {frame},")
        assert time <= wanted + 1e-9
        assert labels == "false" or frame % 4 == 0
        corner = tab.picture("#film .frame")[-40:-20, -40:-20].mean()  # no part and no hand there
        assert abs(corner - 4 * frame) < 3
        for part in twin.parts:
            state = float(np.interp(7.0 + time, part.motion.times, part.motion.state))
            assert tab.run(
                f"funtwin.told.parts.find((p) => p.name === '{part.name}').state"
            ) == pytest.approx(state, abs=2e-5)


def test_labels_lie_over_the_picture(tab: Tab) -> None:
    tab.run("document.querySelector('#film input').checked = true; funtwin.clock.go(0);")
    tab.run("document.querySelector('#film .labels').decode()")
    settled(tab)
    picture = tab.picture("#film .frame").astype(int)
    left, right = picture[-40:-20, 20:40], picture[-40:-20, -40:-20]
    assert (left[..., 2] - left[..., 0]).mean() > 40  # the first part is blue
    assert np.ptp(right.reshape(-1, 3).mean(axis=0)) < 3
    tab.run("document.querySelector('#film input').click()")
    settled(tab)
    assert np.ptp(tab.picture("#film .frame")[-40:-20, 20:40].reshape(-1, 3).mean(axis=0)) < 3
    tab.run("document.querySelector('#film input').click()")


@pytest.mark.parametrize("layer", ["seen", "collision", "axes", "paths"])
def test_layers_switch(tab: Tab, layer: str) -> None:
    tab.run("document.querySelector('button[name=home]').click(); funtwin.orbit.zoom(2)")
    switch = f"document.querySelector('input[data-layer={layer}]').click()"
    settled(tab)
    before = tab.picture("#view").astype(int)
    tab.run(switch)
    settled(tab)
    changed = np.abs(tab.picture("#view").astype(int) - before).max(axis=-1) > 8
    tab.run(switch)
    settled(tab)
    assert changed.sum() > 30
    assert np.array_equal(tab.picture("#view"), before)


def test_the_first_view_is_the_same_after_another_with_its_own_angle(tab: Tab) -> None:
    home = "document.querySelector('button[name=home]').click()"
    tab.run(home)
    settled(tab)
    before = tab.picture("#view")
    tab.run("funtwin.orbit.look([3, -3, 1], [0, 0, 0.5], 20); funtwin.resize()")
    settled(tab)
    assert not np.array_equal(tab.picture("#view"), before)
    tab.run(home)
    settled(tab)
    assert np.array_equal(tab.picture("#view"), before)


def late(tab: Tab) -> None:
    """Make the next drawing come as on a machine that is late, with half as many pixels a side."""
    tab.run(
        "new Promise((done) => {let count = 0; const slow = () => {const end = performance.now() + 60;"
        " while (performance.now() < end); funtwin.changed();"
        " if (++count < 12 && funtwin.renderer.getPixelRatio() === 1) requestAnimationFrame(slow); else done();};"
        " slow();})"
    )
    assert tab.run("funtwin.renderer.getPixelRatio()") == 0.5


def test_late_drawings_have_fewer_pixels_and_a_still_one_has_all(tab: Tab) -> None:
    settled(tab)
    whole = tab.picture("#view")
    late(tab)
    settled(tab)
    assert tab.run("funtwin.renderer.getPixelRatio()") == 1
    assert np.array_equal(tab.picture("#view"), whole)
    late(tab)  # at rest all come back by themselves
    tab.until("funtwin.renderer.getPixelRatio() === 1")


@pytest.mark.parametrize(
    ("took", "is_late"),
    [
        ([70] * 3, False), ([70] * 4, True), ([500] * 4, True), ([16] * 20, False), ([70, 16] * 20, False),
        ([70] * 4 + [16], False), ([70] * 9 + [16] + [70], True),
    ],
)  # fmt: skip
def test_drawings_are_late_by_the_time_that_they_take(tab: Tab, took: list[int], is_late: bool) -> None:
    """ms from each drawing to the browser's next frame."""
    assert (
        tab.run(f"(() => {{const p = new Pace(); {took}.forEach((ms) => p.took(ms)); return p.late;}})()")
        is is_late
    )


@pytest.mark.parametrize(("frame", "pause", "pixels"), [(16, 70, 1), (70, 0, 0.5)])
def test_what_is_asked_for_seldom_is_not_late(tab: Tab, frame: int, pause: int, pixels: float) -> None:
    """Six drawings with the browser's frames told by hand, ms: how soon the next comes, and then nothing."""
    settled(tab)
    told = tab.run(
        "(() => {const real = requestAnimationFrame; let [now, queue] = [0, []];"
        " window.requestAnimationFrame = (f) => queue.push(f);"
        " const next = () => {const due = queue; queue = []; due.forEach((f) => f(now));};"
        f" for (let k = 0; k < 6; k++) {{funtwin.changed(); next(); now += {frame}; next(); now += {pause};}}"
        " window.requestAnimationFrame = real; return funtwin.renderer.getPixelRatio();})()"
    )
    assert told == pixels
    settled(tab)


def test_a_distance_is_measured_between_two_points(tab: Tab, twin: Twin) -> None:
    """Two points of the closed door, left and right of the middle of the page's first view."""
    for part in twin.parts:
        slide(tab, part.name, 0.0, 1.0)
    tab.run(
        "document.querySelector('button[name=home]').click(); document.querySelector('button[name=measure]').click()"
    )
    settled(tab)
    points = []
    for share in (0.45, 0.55):
        point = tab.run(
            "(() => {const box = document.querySelector('#view canvas').getBoundingClientRect();"
            f" const [x, y] = [{share} * box.width, 0.5 * box.height];"
            " for (const type of ['pointerdown', 'pointerup']) document.querySelector('#view canvas').dispatchEvent("
            " new PointerEvent(type, {clientX: box.x + x, clientY: box.y + y, pointerId: 1}));"
            " return funtwin.measure.pick(x, y);})()"
        )
        assert point is not None
        points.append(np.array(point))
    told = tab.run("document.querySelector('.measured').textContent")
    assert told == f"{1000 * np.linalg.norm(points[0] - points[1]):.1f} mm"
    assert all(distance_to(twin.part("door").mesh, p) < 1e-4 for p in points)
    tab.run("document.querySelector('button[name=measure]').click()")


def test_on_a_phone_nothing_is_wider_than_the_screen(tab: Tab) -> None:
    tab.size(390, 844)
    settled(tab)
    try:
        assert tab.run("document.documentElement.scrollWidth") <= 390
        assert tab.run("document.querySelector('#view').getBoundingClientRect().width") > 300
    finally:
        tab.size(1400, 1000)
        settled(tab)


def test_without_webgl_there_are_pictures(page: Path, tmp_path: Path) -> None:
    with browser(tmp_path, "--disable-3d-apis") as tab:
        tab.open(page.as_uri())
        assert tab.run("funtwin.ready") is False
        assert tab.run("document.querySelector('.stills').open") is True
        assert tab.run("getComputedStyle(document.querySelector('#clock')).display") == "none"


def test_what_the_scripts_are_told_is_the_twin(twin: Twin, tmp_path: Path) -> None:
    told = viewer.scene_document(tmp_path, twin)
    json.dumps(told, allow_nan=False)
    assert told["film"] == {"frames": []}
    assert twin.cameras is not None
    assert told["cameras"]["times"][0] == 0
    assert np.allclose(told["cameras"]["positions"], twin.cameras.T_world_cam[:, :3, 3], atol=1e-5)
    for part, one in zip(twin.parts, told["parts"], strict=True):
        assert np.allclose(np.array(one["times"]) + 7.0, part.motion.times, atol=1e-5)
        assert (one["lower"], one["upper"]) == (part.joint.lower, part.joint.upper)


def test_the_film_has_the_frames_with_labels_and_no_more_than_it_may(twin: Twin) -> None:
    assert twin.cameras is not None
    many = np.arange(1000)
    cameras = replace(
        twin.cameras, frames=many, times=many / 15, T_world_cam=np.tile(np.eye(4), (1000, 1, 1))
    )
    labels = dict.fromkeys((3, 501, 998), twin.labels[0])
    frames = report.film_frames(replace(twin, cameras=cameras, labels=labels))
    assert {3, 501, 998} <= set(frames)
    assert len(frames) <= 240 + 3
    assert frames == sorted(frames)


def test_another_film_takes_the_place_of_the_first(twin: Twin, tmp_path: Path) -> None:
    report.save_film(tmp_path, [0, 4, 8], pictured)
    report.save_film(tmp_path, [4, 5], pictured)
    assert sorted(p.name for p in (tmp_path / "report" / "film").glob("*.jpg")) == [
        "000004.jpg",
        "000005.jpg",
    ]


def test_a_twin_that_can_t_move_has_a_page_without_scene(twin: Twin, tmp_path: Path) -> None:
    part = twin.parts[0]
    stuck = replace(
        part,
        joint=replace(part.joint, lower=0.0, upper=0.0),
        motion=replace(part.motion, state=0 * part.motion.state),
    )
    save(replace(twin, parts=(stuck,)), tmp_path / "twin")
    text = render(tmp_path).read_text(encoding="utf-8")
    assert 'id="glb"' not in text
    assert "door" in text


def test_another_trimesh_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(trimesh, "__file__", str(tmp_path / "__init__.py"))  # no viewer beside it
    viewer.three_js.cache_clear()
    with pytest.raises(SceneError, match="ships no viewer"):
        viewer.three_js()
    viewer.three_js.cache_clear()


def test_only_the_library_is_taken() -> None:
    text = viewer.three_js()
    assert text.startswith("/**\n * @license")
    assert "SPDX-License-Identifier: MIT" in text[:200]
    assert not re.search(r"B64GLTF|tracklight|</script", text)


def test_a_notebook_shows_the_twin_in_a_frame_of_its_own(twin: Twin, tmp_path: Path) -> None:
    shown = tw.show(twin, height=500)
    frame = shown._repr_html_()
    assert frame.startswith('<iframe sandbox="allow-scripts"')
    assert "500px" in frame
    assert HOSTILE not in frame
    assert "MB" in repr(shown)
    with pytest.raises(InputError, match="px high"):
        tw.show(twin, height=0)
    page = tmp_path / "notebook.html"
    page.write_text(f"<!doctype html><title>n</title>{frame}", encoding="utf-8")
    with browser(tmp_path / "profile") as tab:
        tab.open(page.as_uri())
        tab.until("document.querySelector('iframe') && 1")
        time.sleep(2.0)
        assert tab.complaints == []
        assert len(np.unique(tab.picture("iframe").reshape(-1, 3), axis=0)) > 200  # something is drawn
