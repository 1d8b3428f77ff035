"""Rest is evidence: a part that stayed without a hand is held by friction, a catch or a balance.

A rest is a stretch of frames outside the moving intervals in which labelled frames follow each other, the
part is seen in each, no pixel of any is a hand's, and the part's state stands still. Without labels there is
none. Where the part's weight, with that of what it carries, pulls along the joint and not against a stop, the
joint must hold as much. Its friction loss stands for whatever does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin import geometry as geo
from twin.geometry import Array
from twin.level import doubts_about_up
from twin.physics.joints import resistance, weight_on_lever
from twin.physics.materials import JointLaw, MaterialTable, read_materials
from twin.physics.parts import inertial_of
from twin.physics.simulation import GRAVITY
from twin.quantities import Quantity
from twin.scene import HAND_LABEL, Part, Revolute, Twin

# s, least length of a rest; chosen by us: in it a drawer that nothing holds on a slope of 3 degrees goes 6 cm
SECONDS = 0.5
GAP = 1.0  # s, most between its labelled frames; chosen by us: in less no hand comes, holds the part and goes
STEADY = {  # rad, m; chosen by us: twice the 1 degree and 4 mm by which the states of resting parts wander
    "revolute": float(np.radians(2.0)),
    "prismatic": 0.008,
}
# x the least holding; chosen by us: at 1 a part is on the edge of sliding, and an engine's friction is soft
MARGIN = 1.1
# frames beside a moving interval in which the part may still move, as the reconstruction's verdict has it
_BESIDE = 2
_FOLLOWS = ("default", "recording")  # origins of a friction loss that nobody stated


@dataclass(frozen=True)
class Rest:
    """Where a part stayed with no hand in view.

    Attributes:
        first: recording frame with which it begins.
        last: and ends.
        state: m or rad; that of the stop where it is as near to one as a rest is steady.
        others: part id -> state of the other parts.
        pull: of the weight that the joint carries, N or N m, positive opens.
        stopped: whether the pull is against a stop.
        caught: what a catch that the twin states holds there against being opened, N or N m.
    """

    first: int
    last: int
    state: float
    others: Mapping[int, float]
    pull: float
    stopped: bool
    caught: float = 0.0

    @property
    def least(self) -> float:
        """Least friction (N or N m) that keeps the part there: none where a stop does, or a catch."""
        if self.stopped:
            return 0.0
        return max(0.0, self.pull - self.caught) if self.pull > 0 else -self.pull


def rests(twin: Twin, key: int | str) -> tuple[Rest, ...]:
    """When and where a part rested with no hand in view, in order of time.

    Of rests at the same state, as near as a rest is steady, the one that asks for most, of these the longest.

    Args:
        twin: with the masses of the part and what it carries, and its labels.
        key: name or id of the part.

    Raises SceneError: no such part, or one without a mass.
    """
    part, found = twin.part(key), list[Rest]()
    for first, last in _unhanded(twin, part):
        rest = _rest(twin, part, first, last)
        found += [] if rest is None else [rest]
    kept: list[Rest] = []
    for rest in sorted(found, key=lambda r: (-r.least, r.first - r.last)):
        if all(abs(rest.state - k.state) > STEADY[part.joint.kind] for k in kept):
            kept.append(rest)
    return tuple(sorted(kept, key=lambda r: r.first))


def weight_pull(twin: Twin, part: Part, states: Mapping[int, float]) -> float:
    """Pull (N or N m, positive opens) along a part's joint of its weight and that of all it carries.

    The power of the weights at unit speed of the joint, -g sum m (d c / d q)_z; c (3,): centres of mass.

    Args:
        twin: with the masses.
        part: whose joint it is.
        states: part id -> m or rad, 0 where not named.
    """
    carrier = np.eye(4) if part.parent is None else twin.part_pose(part.parent, states)
    axis, lift = geo.rotate(carrier, part.joint.axis), 0.0
    for body in carried(twin, part):
        own, move = inertial_of(body), axis
        if isinstance(part.joint, Revolute):
            points = twin.part_pose(body.id, states) @ [*own.com, 1.0] - carrier @ [*part.joint.pivot, 1.0]
            move = np.cross(axis, points[:3])
        lift += own.mass.value * float(move[2])
    return -GRAVITY * lift


def carried(twin: Twin, part: Part) -> Iterator[Part]:
    """The part, and all that is mounted on it."""
    yield part
    for other in twin.parts:
        if other.parent == part.id:
            yield from carried(twin, other)


def with_rests(twin: Twin, table: MaterialTable | None = None) -> Twin:
    """The twin with joints that hold its parts where they rested.

    A table's friction loss that holds its part at all rests stays, as does every measured or stated one. Any
    other becomes 1.1 x the least that does, unless that is more than dry friction gives (the upper end of the
    table's share) and something speaks against the twin's up: then it stays, and `unheld` tells.
    """
    table = read_materials() if table is None else table
    doubted: bool | None = None  # looked at once, and only where it matters
    parts = list(twin.parts)
    for k, part in enumerate(parts):
        if part.physics is None or not _weighed(twin, part):
            continue
        now, law = part.physics.frictionloss, table.joints[part.joint.kind]
        asked = _asked(twin, part, now, law)
        if asked is None:
            continue
        loss, beyond = asked
        if beyond:
            doubted = bool(doubts_about_up(twin)) if doubted is None else doubted
            loss = _usual(part, now, law) if doubted else loss
        if loss != now:
            parts[k] = replace(part, physics=replace(part.physics, frictionloss=loss))
    same = all(a is b for a, b in zip(parts, twin.parts, strict=True))
    return twin if same else replace(twin, parts=tuple(parts))


def without_rests(twin: Twin, table: MaterialTable | None = None) -> Twin:
    """The twin with the friction losses that the table gives, where rests asked for more."""
    table = read_materials() if table is None else table
    parts = list(twin.parts)
    for k, part in enumerate(parts):
        if part.physics is not None and part.physics.frictionloss.origin == "recording":
            usual = _usual(part, part.physics.frictionloss, table.joints[part.joint.kind])
            parts[k] = replace(part, physics=replace(part.physics, frictionloss=usual))
    return replace(twin, parts=tuple(parts))


def unheld(twin: Twin) -> tuple[str, ...]:
    """One line for every part that, by its friction loss, does not stay where the recording left it."""
    told = []
    for part in twin.parts:
        if part.physics is None or not _weighed(twin, part):
            continue
        loss = part.physics.frictionloss
        worst = _worst(twin, part, loss.value)
        if worst is None or worst.least <= loss.value:
            continue
        unit = "N m" if part.joint.kind == "revolute" else "N"
        asks = f"its weight asks for {worst.least:.2g} {unit} and the joint holds {loss.value:.2g} {unit} ({loss.origin})"
        told.append(
            f"{part.name} rested {place(part, worst)} and will not stay there: {asks}; {_remedy(twin, part, loss)}"
        )
    return tuple(told)


def place(part: Part, rest: Rest) -> str:
    """Where and when, for people."""
    at = f"{np.degrees(rest.state):.0f} deg" if part.joint.kind == "revolute" else f"{rest.state:.3f} m"
    return f"at {at} in frames {rest.first} to {rest.last}"


def _weighed(twin: Twin, part: Part) -> bool:
    """Whether the part and all it carries have a mass."""
    return all(p.inertial is not None for p in carried(twin, part))


def _remedy(twin: Twin, part: Part, loss: Quantity) -> str:
    if loss.origin not in _FOLLOWS:
        return f"`twin physics set --part {part.name} --frictionloss` states another"
    doubts = doubts_about_up(twin)
    return f"up is in doubt, so it is not raised: {doubts[0]}" if doubts else "`twin export` raises it"


def _usual(part: Part, now: Quantity, law: JointLaw) -> Quantity:
    """The friction loss without the rests' demand: as it stands if from a table, else by the law."""
    return now if now.origin == "default" else resistance(part.joint, inertial_of(part), law)["frictionloss"]


def _asked(twin: Twin, part: Part, now: Quantity, law: JointLaw) -> tuple[Quantity, bool] | None:
    """Friction loss that a part's rests ask for, and whether it is beyond dry friction; None: not told."""
    if now.origin not in _FOLLOWS:
        return None
    worst = _worst(twin, part, now.value if now.origin == "default" else 0.0)
    if worst is None:
        return None
    usual = _usual(part, now, law)
    if worst.least <= usual.value:
        return usual, False
    beyond = worst.least > law.friction.interval[1] * weight_on_lever(part.joint, inertial_of(part))
    masses = [inertial_of(p).mass for p in carried(twin, part)]
    low, high = min(m.interval[0] / m.value for m in masses), max(m.interval[1] / m.value for m in masses)
    what = (
        "a catch or a balance: it is more than dry friction gives"
        if beyond
        else "friction, a catch or a balance"
    )
    source = f"recording: {MARGIN:g} x the pull of its weight {place(part, worst)}, where it rested; held by {what}"
    top = max(high * MARGIN * worst.least, usual.interval[1])
    return Quantity(MARGIN * worst.least, source, (low * worst.least, top)), beyond


def _worst(twin: Twin, part: Part, holds: float) -> Rest | None:
    """The rest that asks for most; None without, or (unread) where none asks for more than `holds`."""
    near, asks = STEADY[part.joint.kind], 0.0
    for frames, states in _between(part):
        others = _others(twin, part, int(frames[0]), int(frames[-1]))
        for state in (states.min() - near, states.mean(), states.max() + near):
            asks = max(asks, abs(weight_pull(twin, part, {**others, part.id: float(state)})))
    return None if asks <= holds else max(rests(twin, part.id), key=lambda r: r.least, default=None)


def _between(part: Part) -> list[tuple[NDArray[np.int64], Array]]:
    """Frames and states of each stretch outside the moving intervals and two frames beside them."""
    motion = part.motion
    moving = np.zeros(len(motion.frames), dtype=bool)
    for first, last in motion.intervals:
        moving |= (motion.frames >= first - _BESIDE) & (motion.frames <= last + _BESIDE)
    stretch = np.cumsum(np.diff(moving, prepend=moving[:1]))
    picks = [~moving & (stretch == k) for k in np.unique(stretch[~moving])]
    return [(motion.frames[p], motion.state[p]) for p in picks]


def _unhanded(twin: Twin, part: Part) -> Iterator[tuple[int, int]]:
    """First and last labelled frames of each run, long enough, in which the part is seen and no hand is."""
    motion = part.motion
    for frames, _ in _between(part):
        labelled = [k for k in sorted(twin.labels) if frames[0] <= k <= frames[-1]]
        times = dict(zip(labelled, np.interp(labelled, motion.frames, motion.times), strict=True))
        run: list[int] = []
        for k in (*labelled, -1):
            if k >= 0 and _alone(twin, part, k) and (not run or times[k] - times[run[-1]] <= GAP):
                run.append(k)
                continue
            if run and times[run[-1]] - times[run[0]] >= SECONDS:
                yield run[0], run[-1]
            run = []


def _alone(twin: Twin, part: Part, frame: int) -> bool:
    """The part is seen in a labelled frame, and no hand."""
    image = twin.labels[frame]
    return bool((image == part.id).any()) and not bool((image == HAND_LABEL).any())


def _rest(twin: Twin, part: Part, first: int, last: int) -> Rest | None:
    """The rest in these frames; None where the state is not steady or not known."""
    joint, motion = part.joint, part.motion
    states = motion.state[(motion.frames >= first) & (motion.frames <= last)]
    if len(states) < 2 or np.ptp(states) > STEADY[joint.kind]:
        return None
    state = _placed(part, float(np.median(states)))
    others = _others(twin, part, first, last)
    pull = weight_pull(twin, part, {**others, part.id: state})
    stopped = state == (joint.lower if pull < 0 else joint.upper)
    caught = 0.0 if part.physics is None else part.physics.caught(state)
    return Rest(first, last, state, others, pull, stopped, caught)


def _others(twin: Twin, part: Part, first: int, last: int) -> dict[int, float]:
    """Part id -> state of every other part in the middle of these frames; closed where it was not seen."""
    out = {}
    for p in twin.parts:
        if p is not part:
            seen = len(p.motion.frames) > 0
            middle = float(np.interp((first + last) / 2, p.motion.frames, p.motion.state)) if seen else 0.0
            out[p.id] = _placed(p, middle)
    return out


def _placed(part: Part, state: float) -> float:
    """The state within the limits, and at one where it is as near as a rest is steady."""
    lower, upper = part.joint.lower, part.joint.upper
    state = min(max(state, lower), upper)
    stop = lower if state - lower < upper - state else upper
    return stop if abs(state - stop) <= STEADY[part.joint.kind] else state
