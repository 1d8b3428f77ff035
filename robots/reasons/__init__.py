"""Why a plan is refused or a replay failed: one type for each cause, which alone writes its text.

What happened is the type; causes are counted by `kind`, which leaves the numbers out.
"""

from robots.reasons.plans import InCollision, NoRoom, Reconfigures, TooWeak, Unlawful, Unreachable, reason_of
from robots.reasons.reason import Reason, RefusedError
from robots.reasons.replays import (
    AtTorqueLimit,
    BeyondJointLimit,
    CameBack,
    ClosedByItself,
    IntoScene,
    LostPart,
    NotGripped,
    Slipped,
    StillMoving,
    Stuck,
)

__all__ = [
    "AtTorqueLimit",
    "BeyondJointLimit",
    "CameBack",
    "ClosedByItself",
    "InCollision",
    "IntoScene",
    "LostPart",
    "NoRoom",
    "NotGripped",
    "Reason",
    "Reconfigures",
    "RefusedError",
    "Slipped",
    "StillMoving",
    "Stuck",
    "TooWeak",
    "Unlawful",
    "Unreachable",
    "reason_of",
]
