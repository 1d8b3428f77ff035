"""Rules for the twin of a run folder, which the files made from it can't show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from twin.contacts import contacts_off
from twin.lint.model import Fault
from twin.scene import Twin


@dataclass(frozen=True)
class TwinRule:
    """`find` yields the faults of a twin."""

    find: Callable[[Twin], Iterator[Fault]]
    catches: str
    matters: str


def _contact(twin: Twin) -> Iterator[Fault]:
    for off in contacts_off(twin):
        yield Fault("error", off.part, f"{off.distance:.2f} m", off.problem, off.remedy)


TWIN_RULES: Mapping[str, TwinRule] = {
    "contact-off-part": TwinRule(
        _contact,
        "of a run folder's twin, a contact farther from its part's surface than a hand's error and half of what it holds",
        "every format carries it as a grasp frame, and a robot that trusts it closes on air",
    ),
}
