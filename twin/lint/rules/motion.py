"""What MuJoCo says about the file, and what the parts do in it."""

from __future__ import annotations

from collections.abc import Iterator

from twin.lint.model import Behaviour, Fault, LintModel


def _behaviour(model: LintModel) -> Behaviour:
    return model.behaviour or Behaviour()


def refused(model: LintModel) -> Iterator[Fault]:
    if why := _behaviour(model).refused:
        yield Fault("error", model.path.name, why, "MuJoCo does not load the file", "see its message")


def overlap(model: LintModel) -> Iterator[Fault]:
    yield from _behaviour(model).overlaps


def stuck(model: LintModel) -> Iterator[Fault]:
    yield from _behaviour(model).stuck


def drift(model: LintModel) -> Iterator[Fault]:
    yield from _behaviour(model).drifts
