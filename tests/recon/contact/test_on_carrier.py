"""A part on a part is finished as it stands when it is handled, and written on what carries it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.contact.find_contact import ContactConfig
from recon.contact.finish_parts import FinishedPart, finish_parts
from recon.fusion.fuse import FusedScene
from recon.interaction.parts.moving_part import MovingPart
from recon.verdict.assemble import assemble
from recon.verdict.judge import Judged
from tests.makers.recon.cabinets import Clip, make_clip
from tests.makers.recon.tiny import box
from twin import geometry as geo
from twin.scene import Motion, Prismatic, Twin
from twin.verdict import Verdict, reason

CARRIER = 7
# A box far from all that the clip shows, which was pulled out by 10 cm before the clip begins.
PULLED = 0.1
BOX = box((0.0, -1.0, 0.3), (0.3, 0.3, 0.2))


def carrier_of(clip: Clip) -> MovingPart:
    n = len(clip.recording)
    joint = Prismatic(np.array([0.0, -1.0, 0.0]), 0.0, 0.3)
    return MovingPart(CARRIER, joint, Motion(np.arange(n), clip.recording.times, np.full(n, PULLED)))


def finished(clip: Clip, carried: bool) -> tuple[FinishedPart, ...]:
    """The clip's part, of the static scene or on the box."""
    part, mesh, carrier = clip.part, clip.mesh, carrier_of(clip)
    if carried:
        back = geo.invert_pose(carrier.joint.pose(PULLED))
        part = replace(part, joint=part.joint.transformed(back), carrier=carrier)
        mesh = mesh.transformed(back)
    fused = FusedScene(clip.static, {part.id: mesh, CARRIER: BOX})
    sources = {part.id: "motion", CARRIER: "motion"}
    parts = (part, carrier)
    return finish_parts(clip.recording, clip.cameras, clip.labels, sources, parts, fused, ContactConfig())


def twin_of(clip: Clip, refused: bool) -> Twin:
    verdicts = {
        clip.part.id: Verdict(),
        CARRIER: Verdict((reason("NoSurface", "refused"),) if refused else ()),
    }
    parts = (clip.part, carrier_of(clip))
    done = finished(clip, carried=True)
    judged = Judged(verdicts, (), {})
    return assemble(clip.recording, clip.cameras, clip.static, done, clip.labels, {}, judged, parts, {}, {})


@pytest.fixture(scope="module", params=["door", "drawer"])
def clip(request: pytest.FixtureRequest) -> Clip:
    return make_clip(request.param)


def test_a_carried_part_is_finished_as_one_of_the_static_scene(clip: Clip) -> None:
    alone, carried = finished(clip, carried=False)[0], finished(clip, carried=True)[0]
    assert carried.moving.carrier is not None
    assert carried.moving.carrier.id == CARRIER
    there = carried.standing()
    np.testing.assert_allclose(there.mesh.vertices, alone.mesh.vertices, atol=1e-9)
    np.testing.assert_allclose(there.moving.joint.axis, alone.moving.joint.axis, atol=1e-12)
    assert there.contact is not None
    assert alone.contact is not None
    np.testing.assert_allclose(there.contact.point, alone.contact.point, atol=1e-9)
    assert there.closed.source == alone.closed.source
    assert there.closed.probability == pytest.approx(alone.closed.probability)


@pytest.mark.parametrize("refused", [False, True])
def test_it_is_written_on_its_carrier_or_without_one_in_the_static_scene(clip: Clip, refused: bool) -> None:
    twin, alone = twin_of(clip, refused), finished(clip, carried=False)[0]
    part = twin.part(clip.part.id)
    assert part.parent == (None if refused else CARRIER)
    for frame in (0, len(clip.recording) - 1):
        states = {p.id: p.motion.state[frame] for p in twin.parts}
        there = geo.transform(twin.part_pose(part.id, states), part.mesh.vertices)
        true = geo.transform(alone.moving.joint.pose(states[part.id]), alone.mesh.vertices)
        np.testing.assert_allclose(there, true, atol=1e-9)
