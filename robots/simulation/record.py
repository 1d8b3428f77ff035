"""What a simulation did, as samples over time."""

from __future__ import annotations

from dataclasses import dataclass

from twin.geometry import Array


@dataclass(frozen=True)
class Contact:
    """The robot touches what it should not: time (s), both bodies, depth (m), if the other is static."""

    time: float
    bodies: tuple[str, str]
    depth: float
    static: bool


@dataclass(frozen=True, eq=False)
class Record:
    """What the simulation did, n samples. times (n,) s; phase (n,) index into PHASES, -1 while settling;
    state and speed (n,) of the part; q (n, j); torque (n, j) N m, gravity compensation included; tool (n, 4,
    4); grip (n,) N; touching (n,) fingers that touch the part; contacts that should not be."""

    times: Array
    phase: Array
    state: Array
    speed: Array
    q: Array
    torque: Array
    tool: Array
    grip: Array
    touching: Array
    contacts: tuple[Contact, ...]
