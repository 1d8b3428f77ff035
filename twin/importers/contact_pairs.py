"""Which bodies of an MJCF file never touch: by contype, conaffinity, <exclude>, <pair>, parent and child."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

_BODY_BITS = 16  # mjModel.exclude_signature is (first body << 16) + second body


def touching_geoms(model: Any) -> NDArray[np.bool_]:
    """(ngeom,) geoms that can touch something: with a contype or conaffinity, or in a <pair>."""
    touches = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
    touches[np.asarray(model.pair_geom1, int)] = True
    touches[np.asarray(model.pair_geom2, int)] = True
    return touches


def bodies_never_touching(model: Any) -> set[tuple[int, int]]:
    """Pairs (lower id first) of bodies with geoms that touch, not welded, that MuJoCo never lets touch.

    The rules are those of MuJoCo, "Computation: Collision detection: Selection": two geoms collide when the
    contype of one shares a bit with the conaffinity of the other; an excluded pair of bodies never does, nor
    a body and its parent, unless that stands still; a <pair> always does.
    """
    geoms: dict[int, list[int]] = {}
    for g in np.flatnonzero(touching_geoms(model)):
        geoms.setdefault(int(model.geom_bodyid[g]), []).append(int(g))
    paired = _paired(model)
    excluded = {(int(s) >> _BODY_BITS, int(s) & ((1 << _BODY_BITS) - 1)) for s in model.exclude_signature}
    silent = bool(model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT))
    never_touching = set()
    for a, b in combinations(sorted(geoms), 2):
        if model.body_weldid[a] == model.body_weldid[b]:
            continue
        filtered = {(a, b), (b, a)} & excluded or _parent_and_child(model, a, b)
        touch = (a, b) in paired or (not filtered and _affine(model, geoms[a], geoms[b]))
        if silent or not touch:
            never_touching.add((a, b))
    return never_touching


def _paired(model: Any) -> set[tuple[int, int]]:
    """Pairs of bodies, lower id first, of which a <pair> names two geoms."""
    ends = np.stack([model.geom_bodyid[model.pair_geom1], model.geom_bodyid[model.pair_geom2]], axis=1)
    return {(int(a), int(b)) for a, b in np.sort(ends.reshape(-1, 2), axis=1)}


def _parent_and_child(model: Any, a: int, b: int) -> bool:
    """Whether MuJoCo leaves the pair out because one of them is mounted on the other, which moves."""
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT):
        return False
    weld = model.body_weldid
    first, second = int(weld[a]), int(weld[b])
    above = [int(weld[model.body_parentid[k]]) for k in (first, second)]
    return first != 0 and second != 0 and (first == above[1] or second == above[0])


def _affine(model: Any, mine: list[int], theirs: list[int]) -> bool:
    """Whether any two geoms of two bodies share a bit of contype and conaffinity."""
    t, a = np.asarray(model.geom_contype), np.asarray(model.geom_conaffinity)
    return bool(
        np.any((t[mine][:, None] & a[theirs][None]) != 0) or np.any((t[theirs][None] & a[mine][:, None]) != 0)
    )
