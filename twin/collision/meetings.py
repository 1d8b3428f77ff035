"""Where a twin's collision shapes overlap while parts open, and who gives way without pair filters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

from twin.collision.clearance import STEP, Owners, Yielding, carried, make_clear, points_of, sweep_states
from twin.collision.contact_model import model_of
from twin.collision.convex import hull_of
from twin.scene import Collision, Part, StaticPart, Twin

# m, chosen by us: less deep is rounding. Shapes nearer than that touch: friction holds a dial that stands
# on a table in MuJoCo, without any depth.
_MEET = 1e-4
# m, chosen by us: the clearance of made shapes (CollisionConfig.clearance). Where nothing excludes the
# contact, MuJoCo throws a door without friction 0.2 rad open at 1 mm, 1.0 rad at 2 mm, 1.5 rad from 3 mm on.
AT_REST = 0.002


@dataclass(frozen=True)
class Meeting:
    """Two bodies whose collision shapes overlap or touch.

    Attributes:
        names: of the two, the static scene or the earlier part first.
        depth: m, the deepest overlap while one part opens, and `where` that is, in words; below 0 a gap.
        at_rest: m, the overlap with every part closed.
        filtered: the two are a filtered pair of the twin, which don't collide.
        mounted: one of the two is mounted on the other: no export lets them collide.
        clear: the part and the state (m or rad, with its unit) from which on it keeps clear of the other;
            None where it never does.
        made: which of the two have shapes that were made here; the others were stated.
    """

    names: tuple[str, str]
    depth: float
    where: str
    at_rest: float = 0.0
    filtered: bool = False
    mounted: bool = False
    clear: tuple[str, str] | None = None
    made: tuple[str, ...] = ()

    @property
    def overlaps(self) -> bool:
        """Whether the two do more than touch."""
        return self.depth > _MEET

    @property
    def rests(self) -> bool:
        """Whether the two overlap too deep with every part closed, though nothing says that they may."""
        return self.at_rest > AT_REST and not self.filtered

    @property
    def text(self) -> str:
        """What is wrong, and what to do."""
        a, b = self.names
        if not self.rests:
            return f"the collision shapes of {a!r} and {b!r} overlap by {1e3 * self.depth:.1f} mm {self.where}; {self._why}"
        head = f"the collision shapes of {a!r} and {b!r} overlap by {1e3 * self.at_rest:.1f} mm with every part closed"
        return f"{head}, and nothing says that they may; {self._why}; {self._mend}"

    @property
    def _why(self) -> str:
        if not self.made:
            cut = " in MJCF and USD, which exclude the contact, and are cut in URDF, which can't"
            return f"they were left as stated{cut if self.mounted else ''}"
        return f"those made for {' and '.join(map(repr, self.made))} could not be cut free: state shapes that keep clear"

    @property
    def _mend(self) -> str:
        ends = "give its closed end or its range (`twin import --closed` or `--limit`)"
        if self.clear is not None:
            return f"{self.clear[0]!r} keeps clear from {self.clear[1]} on: {ends}"
        return f"they overlap in every state: name the two in `filtered_pairs` of twin.json if they shall not collide, else {ends}"


def shapes_of(owner: StaticPart | Part) -> tuple[Collision, ...]:
    """The collision shapes written of a body: those of its inferred layer if any, the room's included."""
    layer = owner.completion
    return owner.collision if layer is None else (*layer.shapes, *layer.room_collision)


def filtered_owners(twin: Twin) -> frozenset[Owners]:
    """The filtered pairs of a twin by the numbers of their owners: 0 the static scene, then the parts."""
    number = {owner.name: k for k, owner in enumerate(twin.owners)}
    return frozenset(frozenset((number[a], number[b])) for a, b in twin.filtered_pairs)


def meetings(twin: Twin, made: Set[str] = frozenset(), touching: bool = False) -> list[Meeting]:
    """Every two bodies whose collision shapes overlap while a part opens. A part and the part that carries it
    may overlap.

    Args:
        made: names of the parts and the static scene whose shapes were made here; the others were stated.
        touching: also those that touch.
    """
    least = -_MEET if touching else _MEET
    found: dict[tuple[int, int], list[tuple[float, Part, float]]] = {}
    for owners, depth, part, state in _overlaps(twin):
        if depth > least:
            found.setdefault(owners, []).append((depth, part, state))
    return [_meeting(twin, owners, rows, made) for owners, rows in found.items()]


def _meeting(
    twin: Twin, owners: tuple[int, int], rows: list[tuple[float, Part, float]], made: Set[str]
) -> Meeting:
    names = twin.owners[owners[0]].name, twin.owners[owners[1]].name
    depth, part, state = max(rows, key=lambda row: row[0])
    mounted = {
        (twin.static.name if p.parent is None else twin.part(p.parent).name, p.name) for p in twin.parts
    }
    return Meeting(
        names,
        depth,
        f"with {part.name!r} at {state:.2f} {_unit(part)}",
        max((d for d, _, s in rows if s == 0.0), default=0.0),
        names in twin.filtered_pairs,
        names in mounted,
        _clear_from(twin, owners, rows),
        tuple(n for n in names if n in made),
    )


def _clear_from(
    twin: Twin, owners: tuple[int, int], rows: list[tuple[float, Part, float]]
) -> tuple[str, str] | None:
    """The part of a pair, and the state from which on it alone leaves the pair clear of each other."""
    for part in twin.parts:
        if len(carried(twin, part) & set(owners)) == 1:
            states = _states(part)
            touching = [s for d, p, s in rows if p.id == part.id and d > AT_REST]
            free = [s for s in states if s > max(touching, default=0.0)]
            if free:
                return part.name, f"{min(free):.3g} {_unit(part)}"
    return None


def _states(part: Part) -> list[float]:
    """States from lower to upper, state 0 among them."""
    return sorted({0.0, *(float(s) for s in sweep_states(part, STEP))})


def _unit(part: Part) -> str:
    return "rad" if part.joint.kind == "revolute" else "m"


def _overlaps(twin: Twin) -> Iterator[tuple[tuple[int, int], float, Part, float]]:
    """Owners, depth (m), moving part and its state of every contact while one part opens at a time."""
    import mujoco

    shapes = [list(shapes_of(o)) for o in twin.owners]
    solid = {k for k, own in enumerate(shapes) if own}
    for part in twin.parts:
        moving = carried(twin, part)
        if not (solid & moving and solid - moving):
            continue
        model = model_of(twin, shapes, moving, _MEET)
        data = mujoco.MjData(model)
        owner = [int(model.geom(g).name.split("_")[1]) for g in range(model.ngeom)]
        address = int(model.joint(f"joint_{part.id}").qposadr[0])
        for state in _states(part):
            data.qpos[address] = state
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for (g, h), distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
                a, b = sorted((owner[g], owner[h]))
                yield (a, b), -distance, part, state


def with_pairs_cut(twin: Twin, met: Sequence[Meeting]) -> tuple[Twin, list[str]]:
    """The twin in which pairs that must not collide keep clear because their shapes give way, and a line for
    each body that lost some: for a format that can't filter pairs.

    These are the filtered pairs, and each part with what it is mounted on. What keeps clear stays as it is,
    and so do inferred layers. met: the meetings of the twin, with those that touch.
    """
    number = {owner.name: k for k, owner in enumerate(twin.owners)}
    meet = {frozenset(number[n] for n in m.names) for m in met if m.filtered or m.mounted}
    if not meet:
        return twin, []
    fixed = frozenset(k for k, o in enumerate(twin.owners) if o.completion is not None)
    before = [list(shapes_of(o)) for o in twin.owners]
    after = make_clear(twin, before, AT_REST, STEP, Yielding(fixed, only=meet))
    told = []
    for k in sorted({n for pair in meet for n in pair} - fixed):
        if after[k] != before[k]:
            lost = 1.0 - _volume(after[k]) / max(_volume(before[k]), 1e-12)
            others = " and ".join(repr(twin.owners[o].name) for p in meet if k in p for o in sorted(p - {k}))
            name = twin.owners[k].name
            told.append(
                f"the collision shapes of {name!r} give way to {others}, by {lost:.0%} of their volume"
            )
    parts = tuple(
        p if k in fixed else replace(p, collision=tuple(own))
        for k, (p, own) in enumerate(zip(twin.parts, after[1:], strict=True), 1)
    )
    static = twin.static if 0 in fixed else replace(twin.static, collision=tuple(after[0]))
    return replace(twin, static=static, parts=parts), told


def _volume(shapes: list[Collision]) -> float:
    """Volume (m^3) of shapes, overlaps counted twice."""
    return sum(0.0 if (h := hull_of(points_of(s))) is None else h.volume for s in shapes)
