"""Units of a USD stage, and numbers that are none."""

from __future__ import annotations

from collections.abc import Iterator

from twin.lint.model import Fault, LintModel


def kilograms(model: LintModel) -> Iterator[Fault]:
    if model.units is None:
        return
    if model.units.kilograms is None:
        yield Fault(
            "error", "stage", "not authored", "kilogramsPerUnit is missing", "write kilogramsPerUnit = 1 into the root layer"
        )  # fmt: skip
    elif model.units.kilograms != 1.0:
        yield Fault(
            "error", "stage", f"{model.units.kilograms:g}", "kilogramsPerUnit is not 1, and readers ignore it",
            "convert the masses and write kilogramsPerUnit = 1",
        )  # fmt: skip
    else:
        yield from _others(model, "kilogramsPerUnit")


def metres(model: LintModel) -> Iterator[Fault]:
    if model.units is None:
        return
    if model.units.metres == 1.0:
        yield from _others(model, "metersPerUnit")
        return
    value = "not authored (0.01 by USD's rules)" if model.units.metres is None else f"{model.units.metres:g}"
    yield Fault(
        "error", "stage", value, "metersPerUnit is not 1",
        "convert the lengths and write metersPerUnit = 1 into the root layer",
    )  # fmt: skip


def up_axis(model: LintModel) -> Iterator[Fault]:
    if model.units is None:
        return
    if model.units.up == "Z":
        yield from _others(model, "upAxis")
        return
    value = "not authored (Y by USD's rules)" if model.units.up is None else model.units.up
    yield Fault(
        "error", "stage", value, "upAxis is not Z", 'turn the model and write upAxis = "Z" into the root layer'
    )  # fmt: skip


def _others(model: LintModel, key: str) -> Iterator[Fault]:
    """Layers that were made in other units than the stage that they are part of."""
    for layer, name, value in model.units.others if model.units is not None else ():
        if name == key:
            yield Fault(
                "error", f"layer {layer}", value, f"its {key} is not that of the stage, and USD does not convert it",
                f"convert the layer, and write {key} as in the stage",
            )  # fmt: skip


def unreadable(model: LintModel) -> Iterator[Fault]:
    for element, text in model.unread:
        yield Fault(
            "error",
            element,
            text,
            "it can't be read as the numbers that belong there",
            "write plain numbers, blanks between them",
        )
