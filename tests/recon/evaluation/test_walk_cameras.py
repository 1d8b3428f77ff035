"""The judge of a walk's cameras: loops, pairs inside an interaction, pieces, gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.evaluation.truth import Truth
from recon.evaluation.walk_rows import walk_table
from recon.evaluation.walks import walk_scores
from tests.makers.recon.tiny import JOINTS, in_world, twin_of
from tests.makers.recon.walked import FRAMES, course, score, true_part, truth_of, with_part
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Trajectory, Twin


def bent(exact: Twin, frame: int, T: Array) -> Trajectory:
    """Cameras whose world is another from a frame on."""
    c = exact.cameras
    assert c is not None
    return replace(
        c, T_world_cam=np.where((c.frames >= frame)[:, None, None], T @ c.T_world_cam, c.T_world_cam)
    )


def test_a_bend_between_interactions_costs_the_loop_and_nothing_local(truth: Truth, exact: Twin) -> None:
    walk = walk_scores(
        replace(exact, cameras=bent(exact, 500, geo.make_pose(translation=[0.02, 0, 0]))), truth
    )
    assert max(walk.local.mm) < 1e-9
    assert walk.pieces[0].ate_mm == pytest.approx(20 * np.sqrt(500 * 850) / FRAMES, rel=1e-3)


def test_local_errors_are_those_of_pairs_inside_an_interaction(truth: Truth, exact: Twin) -> None:
    """Of the door's opening, the pairs with a jump of 3 mm between them."""
    walk = walk_scores(
        replace(exact, cameras=bent(exact, 100, geo.make_pose(translation=[0.003, 0, 0]))), truth
    )
    a, b = truth.parts[0].spans[0]
    assert b - a < 60
    off = np.array(walk.local.mm)
    assert np.sum(off > 1.0) == (100 - a) * (b - 100 + 1)
    np.testing.assert_allclose(off[off > 1.0], 3.0)
    assert (
        len(off)
        == walk.local.pairs
        == sum((n := d - c + 1) * (n - 1) // 2 for p in truth.parts for c, d in p.spans)
    )
    turned = walk_scores(
        replace(exact, cameras=bent(exact, 100, geo.make_pose(geo.exp_so3([0, 0, 0.01])))), truth
    )
    assert max(turned.local.deg) == pytest.approx(np.degrees(0.01))


def test_pairs_are_at_most_sixty_frames_apart() -> None:
    joint, mesh, grip = JOINTS["drawer"]
    long = truth_of(true_part(2, "drawer", joint, mesh, grip, course(0.3, (100, 300, 1)), [(100, 300)]))
    a, b = long.parts[0].spans[0]
    assert b - a > 100
    assert walk_scores(twin_of(long), long).local.pairs == sum(b - a + 1 - d for d in range(1, 61))


def test_pieces_that_were_not_joined_are_aligned_each_for_itself(truth: Truth, exact: Twin) -> None:
    """The second half of the walk, and the part that moves there, lie in a world of their own."""
    T = geo.make_pose(geo.exp_so3([0, 0, 1.0]), [2.0, 0, 0])
    moved = {p.name: p for p in in_world(exact, T).parts}
    torn = with_part(replace(exact, cameras=bent(exact, 610, T)), "drawer_right", lambda p: moved[p.name])
    assert walk_scores(torn, truth).pieces[0].ate_mm > 100.0
    pieces = [(610, FRAMES - 1), (0, 609)]
    walk = walk_scores(torn, truth, pieces)
    assert [(p.first, p.last, p.frames) for p in walk.pieces] == [
        (0, 609, 610),
        (610, FRAMES - 1, FRAMES - 610),
    ]
    assert max(p.ate_mm for p in walk.pieces) < 1e-6
    assert "ATE of the piece 0..609" in walk_table(walk)
    assert score(walk, "drawer_right") == ("drawer_right", None)
    a, b = truth.parts[2].spans[0]
    assert walk.local.pairs - len(walk.local.mm) == (610 - a) * (b - 610 + 1)
    assert max(walk.local.mm) < 1e-6


def test_frames_have_a_pose_a_named_gap_or_neither(truth: Truth, exact: Twin) -> None:
    c = exact.cameras
    assert c is not None
    keep = (c.frames < 500) | (c.frames >= 540)
    holed = replace(exact, cameras=Trajectory(c.frames[keep], c.times[keep], c.T_world_cam[keep]))
    poses = walk_scores(holed, truth, gaps=[(495, 519), (510, 529)]).poses
    assert (poses.frames, poses.posed, poses.named, poses.neither) == (FRAMES, FRAMES - 40, 30, 10)


def test_wrong_pieces_and_gaps_are_named(truth: Truth, exact: Twin) -> None:
    for pieces, said in (
        ([(0, 700), (700, FRAMES)], "two pieces .* frame 700"),
        ([(0, 700)], "frame 701 has a pose and lies in no piece"),
        ([(0, FRAMES), (FRAMES + 1, FRAMES + 9)], "no frame of the piece 1351"),
        ([], "frame 0 has a pose"),
    ):
        with pytest.raises(InputError, match=said):
            walk_scores(exact, truth, pieces)
    with pytest.raises(InputError, match=r"gap 9\.\.3 does not lie"):
        walk_scores(exact, truth, gaps=[(9, 3)])
    with pytest.raises(InputError, match="no cameras"):
        walk_scores(replace(exact, cameras=None), truth)
    with pytest.raises(InputError, match="doesn't tell meshes, labels"):
        walk_scores(exact, replace(truth, known=truth.known - {"meshes", "labels"}))
