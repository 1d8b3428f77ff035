"""Keeps what was last computed of surfaces, for whoever asks again: an export, a check and a replay do."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

from twin.shapes import Mesh

Settings = ParamSpec("Settings")
Result = TypeVar("Result")


# Results kept of each function. Chosen by us: the parts of a kitchen.
_MOST = 32


class _Surface:
    """A mesh without colours, equal to any with the same vertices and faces."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self._digest = Mesh(mesh.vertices, mesh.faces), mesh.surface_digest

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Surface) and self._digest == other._digest


def by_surface(
    function: Callable[Concatenate[Mesh, Settings], Result],
) -> Callable[Concatenate[Mesh, Settings], Result]:
    """Keep the last results of a function of a mesh, whose colours it does not ask, and hashable settings."""

    @lru_cache(maxsize=_MOST)
    def of(surface: _Surface, /, *settings: Settings.args, **named: Settings.kwargs) -> Result:
        return function(surface.mesh, *settings, **named)

    @wraps(function)
    def kept(mesh: Mesh, /, *settings: Settings.args, **named: Settings.kwargs) -> Result:
        return of(_Surface(mesh), *settings, **named)  # type: ignore[arg-type]  # what is not hashable raises

    return kept
