"""What a person does on a walk: which fronts are opened and closed, in which order, how far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from recon.simulate.random.strata import WalkStratum
from recon.simulate.timeline import Episode, Leg
from recon.simulate.walk.layout import Layout, Stand
from recon.simulate.walk.solids import Solids, meets
from twin.scene import Prismatic

Rng = np.random.Generator
# m that boxes may lie in each other: what hinges in the middle of a board, and gaps, bring along
SLACK = 0.004
# States of a part on its way that are looked at
_WAY = 7
# Share of a joint's range that a motion covers at least, and of an opening at least
_LEAST, _OPENING = 0.3, 0.5
# rad from which a door lets the drawer behind it out
_OUT_OF_THE_WAY = 1.6
# Mean of a move, m/s or rad/s
_SPEED = {"prismatic": (0.12, 0.4), "revolute": (0.4, 1.2)}
# Share of the parts that stand half open at the start
_AJAR = 0.2
_TRIES = 60


@dataclass
class Plan:
    """The parts' joints, their states at the start by name, and the interactions in their order."""

    joints: list[str]
    start: dict[str, float]
    episodes: list[Episode] = field(default_factory=list)

    def states(self, until: int) -> dict[str, float]:
        """State of each part before interaction `until`."""
        out = dict(self.start)
        for episode in self.episodes[:until]:
            out[episode.joint] = episode.levels[-1]
        return out


def draw_plan(rng: Rng, layout: Layout, wanted: WalkStratum) -> Plan | None:
    """Parts and interactions of a walk; None where none was found whose parts keep clear of each other."""
    for _ in range(_TRIES):
        joints = _parts(rng, layout, wanted.parts)
        if len(joints) < wanted.parts:
            continue
        plan = Plan(joints, _ajar(rng, layout, joints))
        if all(_clear(layout, j, [s], plan.start) for j, s in plan.start.items() if s > 0.0) and all(
            _add(rng, layout, plan, j) for j in _order(rng, layout, joints, wanted)
        ):
            return plan
    return None


def _parts(rng: Rng, layout: Layout, count: int) -> list[str]:
    """Fronts to be handled: several of one row where there is one, now and then one behind another, and some
    from other pieces."""
    cells = {name: c for name, (_, c) in layout.cells.items()}
    found: list[str] = []
    hidden = [n for n, c in cells.items() if c.behind]
    if hidden and count > 3 and rng.random() < 0.6:
        inner = str(rng.choice(hidden))
        found += [str(cells[inner].behind), inner]
    rows: dict[str, list[str]] = {}
    for name, cell in cells.items():
        if not cell.behind:
            rows.setdefault(cell.row, []).append(name)
    alike = [names for names in rows.values() if len(names) > 1]
    if alike and rng.random() < 0.75:
        names = alike[int(rng.integers(len(alike)))]
        taken = rng.permutation(len(names))[: min(2 if count < 5 else 3, len(names))]
        found += [names[k] for k in taken if names[k] not in found]
    pieces = [s for s in layout.stands if s.piece.cells]
    for stand in (pieces[k] for k in rng.permutation(len(pieces))):
        free = [c.name for c in stand.piece.cells if c.name not in found and not c.behind]
        if free and not any(c.name in found for c in stand.piece.cells):
            found.append(str(rng.choice(free)))
    rest = [n for n, c in cells.items() if n not in found and not c.behind]
    found += [rest[k] for k in rng.permutation(len(rest))]
    return found[:count]


def _ajar(rng: Rng, layout: Layout, joints: Sequence[str]) -> dict[str, float]:
    """States at the start."""
    linked = {c.behind for _, c in layout.cells.values()}
    out = {}
    for joint in joints:
        cell = layout.cells[joint][1]
        ajar = rng.random() < _AJAR and not cell.behind and joint not in linked
        out[joint] = float(rng.uniform(0.2, 0.6)) * cell.front.joint.upper if ajar else 0.0
    return out


def _order(rng: Rng, layout: Layout, joints: Sequence[str], wanted: WalkStratum) -> list[str]:
    """Joints as they are handled: each at least once, a third or more of them again.

    Each thing in turn goes round the room, mixed goes anywhere. With loops the further visits come after all
    else has been seen, without them everything at a piece is done before the next one.
    """
    more = max(wanted.interactions - len(joints), 0)
    again = [joints[k] for k in rng.permutation(len(joints))[: max(1, -(-len(joints) // 3))]]
    further = [again[k % len(again)] for k in range(more)]
    stands = {j: layout.cells[j][0] for j in joints}
    angles = {j: float(np.arctan2(*stands[j].middle[1::-1])) for j in joints}
    first, way = float(rng.uniform(-np.pi, np.pi)), float(rng.choice([-1.0, 1.0]))
    round_ = sorted(joints, key=lambda j: ((way * (angles[j] - first)) % (2 * np.pi), j))
    if not wanted.loops:
        return _without_return(rng, round_, further, stands, wanted.order == "mixed")
    if wanted.order == "in_turn":
        return _doors_first(layout, round_) + further
    mixed = [joints[k] for k in rng.permutation(len(joints))]
    order = _doors_first(layout, mixed)
    for joint in further:  # anywhere after the last time, but not at once
        last = max(k for k, j in enumerate(order) if j == joint)
        order.insert(int(rng.integers(min(last + 2, len(order)), len(order) + 1)), joint)
    return order


def _without_return(
    rng: Rng, round_: Sequence[str], further: Sequence[str], stands: Mapping[str, Stand], mixed: bool
) -> list[str]:
    order: list[str] = []
    for name in dict.fromkeys(stands[j].name for j in round_):
        here = [j for j in round_ if stands[j].name == name]
        again = [j for j in further if j in here]
        if mixed:
            order += here + [again[k] for k in rng.permutation(len(again))]
        else:
            order += [j for one in here for j in [one, *(a for a in again if a == one)]]
    return order


def _doors_first(layout: Layout, order: Sequence[str]) -> list[str]:
    """The same with each door before what is behind it."""
    out = list(order)
    for joint in order:
        before = layout.cells[joint][1].behind
        if before in out and out.index(before) > out.index(joint):
            out.remove(before)
            out.insert(out.index(joint), before)
    return out


def _add(rng: Rng, layout: Layout, plan: Plan, joint: str) -> bool:
    """Add an interaction with a part where one keeps clear of all others; whether it did."""
    states = plan.states(len(plan.episodes))
    _, cell = layout.cells[joint]
    if cell.behind and states.get(cell.behind, 0.0) < _OUT_OF_THE_WAY:
        return False
    for _ in range(4):
        legs = _legs(rng, layout, joint, states[joint])
        ends = [states[joint], *(leg.to for leg in legs)]
        way = np.concatenate([np.linspace(a, b, _WAY) for a, b in pairwise(ends)])
        if _clear(layout, joint, [float(s) for s in way], states):
            times = rng.uniform([0.2, 0.6, 0.15, 0.5], [0.6, 1.0, 0.35, 0.8])
            wait, reach, hold, leave = (float(t) for t in times)
            plan.episodes.append(Episode(joint, states[joint], legs, wait, reach, hold, leave))
            return True
    return False


def _legs(rng: Rng, layout: Layout, joint: str, start: float) -> tuple[Leg, ...]:
    """An opening where it is nearly shut, else a closing, or now and then further open; some with a pause."""
    _, cell = layout.cells[joint]
    upper = float(cell.front.joint.upper)
    kind = "prismatic" if isinstance(cell.front.joint, Prismatic) else "revolute"
    hides = any(c.behind == joint for _, c in layout.cells.values())
    if start < _LEAST * upper:
        end = max(float(rng.uniform(_OPENING, 1.0)) * upper, start + _LEAST * upper)
        end = upper if hides else min(end, upper)
    elif start < (1.0 - _LEAST) * upper and rng.random() < 0.3:
        end = upper
    else:
        end = 0.0 if rng.random() < 0.8 else float(rng.uniform(0.02, 0.12)) * upper
    speed = float(np.exp(rng.uniform(*np.log(_SPEED[kind]))))
    seconds = float(np.clip(abs(end - start) / speed, 0.7, 3.0))
    if rng.random() < 0.12:
        middle = start + float(rng.uniform(0.3, 0.7)) * (end - start)
        return (
            Leg(middle, max(0.5, 0.5 * seconds)),
            Leg(middle, float(rng.uniform(0.3, 0.9))),
            Leg(end, max(0.5, 0.5 * seconds)),
        )
    return (Leg(end, seconds),)


def _clear(layout: Layout, joint: str, way: Sequence[float], states: Mapping[str, float]) -> bool:
    """Whether a part at the states of `way` meets nothing else in the room."""
    stand, cell = layout.cells[joint]
    others = others_of(layout, joint, states)
    return not any(meets(stand.part(cell, s), others, SLACK) for s in way)


def others_of(layout: Layout, joint: str, states: Mapping[str, float]) -> Solids:
    """All that a part could meet. Shut fronts beside it are left out: they keep clear by their hinges."""
    stand, _ = layout.cells[joint]
    found = [s.still for s in layout.stands]
    for name, (other, cell) in layout.cells.items():
        state = states.get(name, 0.0)
        beside = other is stand and state == 0.0
        if name != joint and not beside:
            found.append(other.part(cell, state))
    return Solids.joined([*found, *layout.others])
