"""Which geoms of an MJCF file are seen.

A geom without contype and conaffinity is there to be seen. One that touches may be the surface itself or
stand in for one: the model's own groups say which. Where some shown group holds visuals, one in which every
geom touches holds colliders (robosuite, LIBERO, RoboCasa: colliders 0, visuals 1), and a geom of it is not
seen where visuals of the same body span it. Groups from 3 on are those that MuJoCo's viewer hides (Menagerie:
visuals 2, colliders 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.geometry import Array

# Groups below this are those that MuJoCo's own viewer shows.
_SHOWN = 3
# Groups in all (mjNGROUP).
_GROUPS = 6
# Share of a collider's extent along each axis that the visuals of its body span where it stands in for them.
# Chosen by us: colliders are cruder than visuals, and a handle that is drawn spans little of its panel.
_SPANNED = 0.5


def seen_geoms(
    model: Any, data: Any, touching: NDArray[np.bool_], asked: Sequence[int]
) -> tuple[NDArray[np.bool_], list[str]]:
    """(ngeom,) geoms that are seen, and notes where the groups don't decide.

    Args:
        data: the model at rest.
        touching: (ngeom,) geoms that can touch something.
        asked: groups that the user says are the visuals; empty to go by the model.

    Raises:
        InputError: a group that MuJoCo doesn't have.
    """
    for number in asked:
        if not 0 <= number < _GROUPS:
            raise InputError(f"{number} is no geom group", f"MuJoCo has groups 0 to {_GROUPS - 1}")
    group, opaque = np.asarray(model.geom_group), _alpha(model) > 0
    if asked:
        return opaque & np.isin(group, asked), []
    shown = opaque & (group < _SHOWN)
    visuals = shown & ~touching
    covered = _covered(model, data, visuals, shown & touching)
    seen, notes = shown.copy(), []
    drawn = sorted({int(g) for g in group[visuals]})  # groups of visuals; the others hold colliders
    own = np.isin(group, drawn)
    seen[covered & ~own] = False
    bare = shown & touching & ~covered & ~own
    if (covered & ~own).any() and bare.any():
        options = " ".join(f"--visual-group {g}" for g in drawn)
        notes.append(
            f"{_of(model, bare)} are taken for visible surface, for no visual covers them: {options} leaves them out"
        )
    if (covered & own).any():
        notes.append(
            f"{_of(model, covered & own)} are taken for visible surface, for they are in a group of visuals: where they only"
            f" stand in for those, move them to group {_SHOWN} in the file"
        )
    return seen, notes


def _covered(
    model: Any, data: Any, visuals: NDArray[np.bool_], touching: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(ngeom,) those of `touching` that visuals of the same body span: they may stand in for them."""
    low, high = _boxes(model, data)
    home = _homes(model)
    covered = np.zeros(len(home), bool)
    for g in np.flatnonzero(touching):
        mine = visuals & (home == home[g])
        if mine.any():
            common = np.minimum(high[mine].max(axis=0), high[g]) - np.maximum(low[mine].min(axis=0), low[g])
            covered[g] = bool(np.all(common >= _SPANNED * (high[g] - low[g])))
    return covered


def _of(model: Any, geoms: NDArray[np.bool_]) -> str:
    """Some geoms in words, by their bodies."""
    of = [str(model.body(int(b)).name) or "without a name" for b in np.asarray(model.geom_bodyid)[geoms]]
    bodies = list(dict.fromkeys(of))
    more = f" and {len(bodies) - 3} more" if len(bodies) > 3 else ""
    return f"{int(geoms.sum())} geoms that touch, of {', '.join(map(repr, bodies[:3]))}{more},"


def _alpha(model: Any) -> Array:
    """(ngeom,) 0 for what can't be seen: of the material where there is one."""
    own, material = np.asarray(model.geom_rgba)[:, 3], np.asarray(model.geom_matid)
    if not int(model.nmat):
        return own
    return np.where(material >= 0, np.asarray(model.mat_rgba)[np.maximum(material, 0), 3], own)


def _homes(model: Any) -> NDArray[np.int64]:
    """(ngeom,) the uppermost body that each geom is welded to; the world counts for its own geoms alone."""
    weld, parent = np.asarray(model.body_weldid), np.asarray(model.body_parentid)
    top = np.arange(int(model.nbody))
    for b in range(1, int(model.nbody)):  # parents come first
        above = int(parent[b])
        if above != 0 and weld[above] == weld[b]:
            top[b] = top[above]
    return np.asarray(top[np.asarray(model.geom_bodyid)], np.int64)


def _boxes(model: Any, data: Any) -> tuple[Array, Array]:
    """Lower and upper corners (ngeom, 3) of the boxes around geoms, in the world at rest."""
    turn = np.asarray(data.geom_xmat).reshape(-1, 3, 3)
    middle = np.einsum("nij,nj->ni", turn, model.geom_aabb[:, :3]) + data.geom_xpos
    half = np.einsum("nij,nj->ni", np.abs(turn), model.geom_aabb[:, 3:])
    return middle - half, middle + half
