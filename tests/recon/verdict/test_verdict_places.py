"""Places of a part's surface: those of the true part were seen to move, what is not the part's is
contradicted by its share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.verdict import of_parts
from recon.verdict.evidence import PartEvidence
from recon.verdict.judge import doubts_about
from recon.verdict.places import Places, looked_at
from recon.verdict.posterior import verdict_of
from tests.makers.recon.cabinets import FRAMES, Kind, make_clip
from tests.makers.recon.judged import perfect
from tests.makers.recon.tiny import box, merged
from twin.geometry import Array
from twin.scene import Mesh, Motion


def seen(e: PartEvidence) -> Places:
    assert e.places is not None
    return e.places


def with_mesh(e: PartEvidence, mesh: Mesh) -> PartEvidence:
    return replace(e, mesh=mesh, scene=replace(e.scene, parts=((e.part, mesh),)))


def with_state(e: PartEvidence, state: Array) -> PartEvidence:
    part = replace(e.part, motion=replace(e.part.motion, state=state))
    return replace(e, part=part, scene=replace(e.scene, parts=((part, e.mesh),)))


@pytest.mark.parametrize("kind", ["door", "drawer", "slide"])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_true_part_was_seen_to_move(kind: Kind, backwards: bool) -> None:
    e = perfect(make_clip(kind, backwards=backwards))
    assert of_parts.seen_to_move(e) is None
    assert seen(e).far > 0.9


@pytest.mark.parametrize("share", [0.06, 0.2, 0.3])
def test_a_neighbour_that_was_labelled_part_was_not_seen_to_move(share: float) -> None:
    """The front of the cabinet beside the door, in view all the time and as thin as can be."""
    e = perfect(make_clip("door"))
    assert e.mesh is not None
    side = np.sqrt(share / (1 - share) * e.mesh.area / 2)
    leaked = with_mesh(
        e, merged(e.mesh, box((0.5, -0.016, 1.3), (min(side, 0.3), 0.001, side**2 / min(side, 0.3))))
    )
    np.testing.assert_allclose(seen(leaked).witnessed, (1 - share) * seen(e).witnessed, atol=0.05)


def test_a_wall_behind_the_part_was_not_seen_to_move() -> None:
    """It is hidden where the part would bring it: only the share that was seen to move tells."""
    e = perfect(make_clip("drawer"))
    assert e.mesh is not None
    wall = box((0.0, 0.66, 1.2), (3.0, 0.001, 2.0))
    told = of_parts.seen_to_move(with_mesh(e, merged(e.mesh, wall)))
    assert told.reason.type == "SurfaceUnseen"


def test_what_stays_where_it_was_is_no_part() -> None:
    """The states of a door that opens, of a recording in which nothing does."""
    e = perfect(make_clip("door"))
    still = replace(e.scene.recording, read_depth=lambda _: e.scene.recording.depth(0))
    cameras = replace(e.scene.cameras, T_world_cam=np.repeat(e.scene.cameras.T_world_cam[:1], FRAMES, axis=0))
    false = replace(e, scene=replace(e.scene, recording=still, cameras=cameras))
    assert seen(false).witnessed == 0.0
    reason = of_parts.seen_to_move(false)
    assert reason is not None
    assert verdict_of(doubts_about(false)).level == "refused"


def test_what_hardly_goes_anywhere_is_not_told() -> None:
    e = perfect(make_clip("door"))
    trembling = with_state(e, 0.02 * e.part.motion.state)
    assert seen(trembling).far == 0.0
    assert of_parts.seen_to_move(trembling) is None


def test_frames_end_where_another_part_moves() -> None:
    e = perfect(make_clip("door"))
    motion = e.part.motion
    other = replace(e.part, id=3, motion=replace(motion, intervals=((2, 4), (22, 23))))
    twin = replace(e.scene, parts=((e.part, e.mesh), (other, None))).posed
    frames = looked_at(twin, e.part)
    assert (min(frames), max(frames)) == (5, 21)
    nothing = replace(e.part, motion=Motion(motion.frames, motion.times, motion.state, ()))
    assert looked_at(twin, nothing) == []
    assert replace(e, part=nothing).places is None


def test_a_wall_along_which_it_slides_is_seen_everywhere_but_nowhere_empty() -> None:
    """Above the cabinet: what never leaves a place free was not seen to move, whatever else."""
    e = perfect(make_clip("slide"))
    wall = seen(with_mesh(e, box((-0.3, 0.649, 1.65), (0.8, 0.001, 0.2))))
    assert wall.far > 0.9
    assert wall.witnessed == 0.0
