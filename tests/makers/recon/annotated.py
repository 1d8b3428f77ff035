"""A tiny clip with truth as other data sets annotate it, and what an exact twin of it measures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recon
from benchmarks.layouts import datasets as write
from recon.evaluation.evaluate import Evaluation
from recon.evaluation.known import NEEDS, measurable
from recon.evaluation.truth import Truth
from tests.makers.recon.tiny import twin_of
from twin import geometry as geo
from twin.scene import Recorded, Revolute, Twin

FRAMES = 40
SIZES = {"door": (0.4, 0.06, 0.5), "drawer": (0.4, 0.24, 0.2), "cabinet": (1.2, 0.5, 0.8)}
ONES = {"frames with camera", "type right", "moving frames with state", "interval IoU", "interval precision", "interval recall"}  # fmt: skip
SCENE_ONLY = {"longest gap of labels"}


def exact_twin(own: Truth) -> Twin:
    """The twin that is exactly the truth, in another world."""
    T = geo.make_pose(geo.exp_so3([0.2, -0.1, 2.0]), [3.0, -1.0, 0.5])
    twin = twin_of(own)
    parts = tuple(
        replace(p, mesh=p.mesh.transformed(T), joint=p.joint.transformed(T), contact=None) for p in twin.parts
    )
    static = replace(twin.static, mesh=twin.static.mesh.transformed(T))
    assert twin.cameras is not None
    recorded = Recorded("both", FRAMES, "0")
    return replace(twin, static=static, parts=parts, cameras=twin.cameras.transformed(T), recorded=recorded)


def cameras_of(own: Truth) -> Any:
    assert own.cameras is not None
    return own.cameras.T_world_cam


def annotated(own: Truth) -> list[tuple[str, Any, Any]]:
    """The parts as boxes that are turned against the world, and the cabinet, which is at rest."""
    boxes = []
    for p in own.parts:
        middle = geo.make_pose(geo.exp_so3([0.3, -0.4, 0.2]), p.mesh.area_centroid)
        boxes.append((p.name, p.T_world_part @ middle, SIZES[p.name]))
    rest = np.tile(geo.make_pose(geo.exp_so3([0, 0, 0.1]), [0, 0.8, 1.0]), (FRAMES, 1, 1))
    return [("cabinet", rest, SIZES["cabinet"]), *boxes]


def hoi4d(own: Truth, recording: recon.Recording, out: Path, beside: bool = False, **options: Any) -> Path:
    clip = write.write_hoi4d(recording, out)
    folder = out / "HOI4D_annotations" / write.CLIP if beside else clip
    write.write_hoi4d_annotations(folder, cameras_of(own), options.pop("parts", annotated(own)), **options)
    return clip


def arti4d(own: Truth, recording: recon.Recording, out: Path, cues: Any = None, **options: Any) -> Path:
    axes = {
        p.name: (p.joint.kind.upper(), (2.0 * p.joint.axis).tolist(), (p.joint.pivot if isinstance(p.joint, Revolute) else np.ones(3)).tolist())
        for p in own.parts
    }  # fmt: skip
    if cues is None:
        cues = [(p.name, *p.spans[0], "VERIFIED") for p in own.parts]
    return write.write_arti4d(recording, out, cameras_of(own), axes=axes, cues=cues, **options)


def assert_joints(found: Truth, own: Truth) -> None:
    """Axes within 0.1 deg, hinges within 1 mm, states within 0.1 deg or 0.1 mm up to sign and zero, where
    they are known."""
    assert [p.name for p in found.parts] == [p.name for p in own.parts]
    for p, true in zip(found.parts, own.parts, strict=True):
        assert p.joint.kind == true.joint.kind
        assert np.degrees(geo.line_angle(p.joint.axis, true.joint.axis)) <= 0.1
        if isinstance(p.joint, Revolute) and isinstance(true.joint, Revolute):
            off = geo.line_distance(p.joint.pivot, p.joint.axis, true.joint.pivot, true.joint.axis)
            assert off <= 1e-3
        if found.knows("states"):
            told = np.isfinite(p.states)
            sign = np.sign(p.joint.axis @ true.joint.axis)
            np.testing.assert_allclose(sign * p.states[told], (true.states - true.states[np.argmax(told)])[told], atol=1e-4)  # fmt: skip


def assert_exact(evaluation: Evaluation, truth: Truth) -> None:
    """Zero or one in every row, and a row for every measure that the truth allows, for no other."""
    names = {r.metric for r in evaluation.rows}
    assert names | SCENE_ONLY == {m for m in NEEDS if measurable(m, truth.known)} | SCENE_ONLY
    assert set(evaluation.unknown) == set(NEEDS) - names
    for r in evaluation.rows:
        if r.metric not in SCENE_ONLY:
            assert r.value == pytest.approx(float(r.metric in ONES), abs=2e-3), r
            assert r.matched == r.value, r
    assert evaluation.ok
