"""The scene of the page in a real browser, beside MuJoCo's picture of the export."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy import ndimage

from tests.makers.browser import Tab, browser
from tests.makers.viewer import HOSTILE, settled
from twin.completion.asset import AssetView
from twin.contacts import distance_to
from twin.exporters import export
from twin.geometry import Array
from twin.page import viewer
from twin.report.views import part_view
from twin.scene import Joint, Twin

VIEW = (480, 360)


def slide(tab: Tab, part: str, state: float, scale: float) -> None:
    """Move a slider as a hand does: the value, then the event."""
    tab.run(
        f"(() => {{const i = document.querySelector('.joint[data-part={part}] input');"
        f" i.value = {state * scale}; i.dispatchEvent(new Event('input'));}})()"
    )


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
