"""Why an edit can't be made, or made again."""

from __future__ import annotations

from twin.errors import SceneError


class Unfit(SceneError):
    """The twin is not as it was when the edit was made."""
