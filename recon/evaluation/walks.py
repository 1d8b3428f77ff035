"""Judge the twin of a walk by the truth: which parts it has, when and how far each is open, its cameras.

scores = walk_scores(twin.load("RUN"), load_truth("RECORDING/truth"))
print(walk_table(scores))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from recon.evaluation import metrics
from recon.evaluation.metrics import DistanceField, Span
from recon.evaluation.outcome import INVENTED_AXIS_DEG, PART_MIOU, is_trusted, joint_cause
from recon.evaluation.scores import LabelScore, joint_errors, label_scores
from recon.evaluation.surface_scores import sampled
from recon.evaluation.truth import Truth, TruthPart
from recon.evaluation.walk_cameras import aligned_pieces, alignment_of, in_truth, local_errors, pose_counts
from recon.evaluation.walk_scores import (
    FoundPartScore,
    IntervalCounts,
    Role,
    StateCounts,
    TruePartScore,
    WalkCause,
    WalkScores,
)
from twin import geometry as geo
from twin.errors import InputError
from twin.geometry import Array
from twin.scene import Part, Trajectory, Twin

# What a truth must know, names of `recon.evaluation.known.FACTS`
NEEDS = ("cameras", "intervals", "states", "closed end", "meshes", "labels", "all parts")
# A found part is on a true part's surface with this share of its area within this distance, m; chosen by us:
# the fronts of two neighbours share less, and a part with half of its cabinet still has as much.
SURFACE_SHARE = 0.3
SURFACE_WITHIN = 0.03
# A state is right within these, rad and m; those of success, 5 deg and 2 cm.
STATE_RAD = float(np.radians(5.0))
STATE_M = 0.02


def is_walk(truth: Truth) -> bool:
    """Whether a truth has more than one part, or more than one interaction."""
    return len(truth.parts) > 1 or sum(len(p.spans) for p in truth.parts) > 1


def lacking(truth: Truth) -> tuple[str, ...]:
    """What `walk_scores` needs of a truth and this one doesn't know, by the names of `FACTS`."""
    return tuple(n for n in NEEDS if not truth.knows(n))


def walk_scores(
    twin: Twin,
    truth: Truth,
    pieces: Sequence[Span] | None = None,
    gaps: Sequence[Span] = (),
    labels: Mapping[tuple[int, int], LabelScore] | None = None,
) -> WalkScores:
    """Judge a twin by the truth of a walk.

    Args:
        pieces: first and last frame of the pieces of the cameras' path that were not joined; by default the
            path is one. Each is aligned for itself, and a part by the piece in which it moves.
        gaps: first and last frame of the gaps without poses that the twin's maker names.
        labels: scores of masks that are known already, by ids of the true and of the found part.

    Raises:
        InputError: the truth lacks what a walk's measures need, the twin has no cameras, pieces or gaps don't
            fit them, or labels have another size than the truth's.
    """
    if unknown := lacking(truth):
        raise InputError(f"{truth.folder} doesn't tell {', '.join(unknown)}", "judge it by `evaluate`")
    if twin.cameras is None:
        raise InputError(f"twin {twin.name} has no cameras to align the worlds by", "reconstruct it again")
    cameras = in_truth(twin.cameras, truth)
    path = aligned_pieces(cameras, truth, pieces)
    T = [alignment_of(p.motion, path) for p in twin.parts]
    pairs, roles = match_surfaces(twin.parts, T, truth.parts)
    names = {true.id: twin.parts[pairs[i]].id for i, true in enumerate(truth.parts) if i in pairs}
    masks = _masks(twin, truth, names, labels or {})
    unsolved = {of for role, of in roles if role == "mis-solved"}
    parts = []
    for i, true in enumerate(truth.parts):
        if i in pairs:
            found = twin.parts[pairs[i]]
            parts.append(_matched(found, true, truth, masks.get(true.id), T[pairs[i]], cameras))
        else:
            parts.append(_unmatched(true, "mis-solved" if i in unsolved else "missed", cameras))
    return WalkScores(
        name=truth.name or truth.folder.resolve().parent.name,
        parts=tuple(parts),
        found=tuple(
            FoundPartScore(
                p.name,
                role,
                None if of is None else truth.parts[of].name,
                is_trusted(p),
                len(p.motion.intervals),
            )
            for p, (role, of) in zip(twin.parts, roles, strict=True)
        ),
        pieces=tuple(p.score for p in path),
        local=local_errors(cameras, truth, path),
        poses=pose_counts(cameras.frames, truth.frames, gaps),
    )


def match_surfaces(
    found: Sequence[Part], T_truth_recon: Sequence[Array], true: Sequence[TruthPart]
) -> tuple[dict[int, int], list[tuple[Role, int | None]]]:
    """Index of the true part -> the found one, by surfaces and axes at the most closed states.

    As many pairs as can be, then the best sum of surface shares less axis errors (per 90 deg).

    Args:
        T_truth_recon: for each found part the alignment (4, 4) of its world.

    Returns:
        The pairs, and for each found part its role and the index of the true part it belongs to.
    """
    shares = _surface_shares(found, T_truth_recon, true)
    angles = np.zeros(shares.shape)
    for j, (part, T) in enumerate(zip(found, T_truth_recon, strict=True)):
        axis = geo.rotate(T, part.joint.axis)
        angles[:, j] = [geo.line_angle(axis, t.joint.axis) for t in true]
    possible = (shares >= SURFACE_SHARE) & (np.degrees(angles) <= INVENTED_AXIS_DEG)
    never = 4.0 * (len(found) + len(true) + 1)  # outweighs what any other pairs could gain
    rows, cols = linear_sum_assignment(np.where(possible, angles / (np.pi / 2) - shares, never))
    pairs = {int(i): int(j) for i, j in zip(rows, cols, strict=True) if possible[i, j]}
    taken = {j: i for i, j in pairs.items()}
    roles: list[tuple[Role, int | None]] = []
    for j in range(len(found)):
        if j in taken:
            roles.append(("match", taken[j]))
        elif not len(true) or shares[:, j].max() < SURFACE_SHARE:
            roles.append(("invented", None))
        else:
            of = int(np.argmax(shares[:, j]))
            roles.append(("double" if of in pairs else "mis-solved", of))
    return pairs, roles


def _surface_shares(
    found: Sequence[Part], T_truth_recon: Sequence[Array], true: Sequence[TruthPart]
) -> Array:
    """Shares (true, found) of the found mesh's area within `SURFACE_WITHIN` of the true part's surface."""
    clouds = [geo.transform(T, sampled(p.mesh)) for p, T in zip(found, T_truth_recon, strict=True)]
    shares = np.zeros((len(true), len(found)))
    for i, part in enumerate(true):
        surface = DistanceField(part.closed_mesh)
        for j, points in enumerate(clouds):
            if len(points):
                shares[i, j] = np.mean(surface.distance(points) <= SURFACE_WITHIN)
    return shares


def _masks(
    twin: Twin, truth: Truth, names: Mapping[int, int], known: Mapping[tuple[int, int], LabelScore]
) -> dict[int, LabelScore]:
    """Scores of the masks of true parts, by their id; `names` tells the found parts' ids."""
    unknown = {k: v for k, v in names.items() if (k, v) not in known}
    scores = label_scores(twin.labels, truth, unknown) if unknown else {}
    return {k: known.get((k, v)) or scores[k] for k, v in names.items()}


def _matched(
    found: Part, true: TruthPart, truth: Truth, mask: LabelScore | None, T: Array, cameras: Trajectory
) -> TruePartScore:
    errors = joint_errors(found.joint, found.motion, T, truth, true)
    miou = None if mask is None else mask.miou
    cause: WalkCause | None = joint_cause(errors)
    if cause is None and not _shows_all(found, true):
        cause = "path"
    if cause is None and (miou is None or miou < PART_MIOU):
        cause = "labels"
    hits = metrics.span_hits(true.spans, found.motion.intervals)
    return TruePartScore(
        name=true.name,
        found=found.name,
        cause=cause,
        trusted=is_trusted(found),
        axis_deg=errors.axis_deg,
        path_mm=errors.handle_rmse_mm,
        miou=miou,
        intervals=IntervalCounts(hits, len(true.spans), len(found.motion.intervals)),
        states=state_counts(found, true, cameras.frames),
    )


def _shows_all(found: Part, true: TruthPart) -> bool:
    """Whether a part has a state in some frame of each true interaction: the path is judged over all."""
    return all(np.isin(metrics.span_frames([s]), found.motion.frames).any() for s in true.spans)


def _unmatched(true: TruthPart, cause: WalkCause, cameras: Trajectory) -> TruePartScore:
    return TruePartScore(
        true.name,
        None,
        cause,
        False,
        None,
        None,
        None,
        IntervalCounts(true=len(true.spans)),
        state_counts(None, true, cameras.frames),
    )


def state_counts(found: Part | None, true: TruthPart, posed: NDArray[np.int64]) -> StateCounts:
    """Counts of the posed frames (n,) by a part's state; both states count from the most closed one shown.

    A part is truly not closed where it is further than 2 % of its travel from there. A state of the wrong
    type of joint is wrong. Of no part (None), no state is right, and none is marked unknown.
    """
    told = posed[np.isfinite(true.states[posed])]
    states = true.states[told] - true.closed
    opened = states > metrics.REST_SHARE * true.travel
    if found is None:
        return StateCounts(frames=len(told), opened=int(np.sum(opened)))
    known = np.isin(told, found.motion.frames)
    right = np.zeros(len(told), dtype=bool)
    if found.joint.kind == true.joint.kind:
        limit = STATE_RAD if true.joint.kind == "revolute" else STATE_M
        here = found.motion.state[np.searchsorted(found.motion.frames, told[known])]
        right[known] = np.abs(here - states[known]) <= limit
    return StateCounts(
        frames=len(told),
        right=int(np.sum(right)),
        unknown=int(np.sum(~known)),
        opened=int(np.sum(opened)),
        opened_right=int(np.sum(right & opened)),
        opened_unknown=int(np.sum(~known & opened)),
    )
