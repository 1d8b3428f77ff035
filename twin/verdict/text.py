"""What every verb says first of a twin."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.scene import Twin


def verdict_line(twin: Twin) -> str:
    """One line; of a twin without a verdict what that means, which is no claim."""
    if twin.verdict is not None:
        return f"verdict: {twin.verdict.text}"
    return f"verdict: none, {unjudged(twin)}"


def unjudged(twin: Twin) -> str:
    """Why a twin has no verdict."""
    return "made before verdicts" if twin.recorded is not None else "stated, not reconstructed"
