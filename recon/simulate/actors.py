"""Actors: rendered at their own pose in every frame, or only in some: furniture, hands, carried things."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.simulate.render import Body
from twin.geometry import Array


@dataclass(frozen=True, eq=False)
class Actor:
    """A body with its poses T_world_body (frames, 4, 4) and whether it is there (frames,). body: by frame, so
    that a hand can close; the same object again where nothing changed.
    """

    body: Callable[[int], Body]
    T_world_body: Array
    present: NDArray[np.bool_]

    @staticmethod
    def still(body: Body, frames: int) -> Actor:
        """What stands still."""
        return Actor.moving(body, np.broadcast_to(np.eye(4), (frames, 4, 4)))

    @staticmethod
    def moving(body: Body, T_world_body: Array) -> Actor:
        """What is always there."""
        return Actor(lambda _: body, T_world_body, np.ones(len(T_world_body), dtype=bool))

    def during(self, first: int, last: int) -> Actor:
        """The frames [first, last), counted from 0 again."""
        body = self.body
        return Actor(lambda i: body(i + first), self.T_world_body[first:last], self.present[first:last])
