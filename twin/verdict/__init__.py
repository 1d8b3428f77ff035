"""What a twin and each of its parts is worth: `trusted`, `doubtful` or `refused`, with the reasons.

Who wants to know what is doubted asks for the type of a reason; who counts causes counts `kind`, which leaves
the numbers out. docs/verdicts.md lists them all.
"""

from twin.verdict.document import verdict_document as verdict_document
from twin.verdict.document import verdict_from as verdict_from
from twin.verdict.motion import (
    AxisUnsure,
    CamerasDrift,
    ClosedEndUnsure,
    CreepsAtRest,
    NeverRests,
    NoUncertainty,
    PivotUnsure,
    RangeUnsure,
    TooShort,
    WithinDrift,
)
from twin.verdict.reason import LEVELS as LEVELS
from twin.verdict.reason import Level as Level
from twin.verdict.reason import Reason as Reason
from twin.verdict.reason import StatedReason as StatedReason
from twin.verdict.reason import worst as worst
from twin.verdict.reasons import (
    REASONS,
    ManyDoubts,
    MovesWithDoubted,
    NothingArticulated,
    OfPart,
    OfRecording,
    UpUnsure,
)
from twin.verdict.surface import (
    AlongItself,
    BareBorder,
    FewLabels,
    HandMovesNothing,
    HandWhereNobodyIs,
    LabelledElsewhere,
    NoSurface,
    SmallSurface,
    StaticSeenThrough,
    SurfaceContradicted,
    SurfaceUnseen,
    Unexplained,
)
from twin.verdict.text import unjudged as unjudged
from twin.verdict.text import verdict_line as verdict_line
from twin.verdict.verdict import Verdict as Verdict
from twin.verdict.verdict import of_twin as of_twin
from twin.verdict.video import HalvesDisagree, MotionUnexplained, MotionUnseen, SeenThrough, TracksDisagree

__all__ = [
    "LEVELS",
    "REASONS",
    "AlongItself",
    "AxisUnsure",
    "BareBorder",
    "CamerasDrift",
    "ClosedEndUnsure",
    "CreepsAtRest",
    "FewLabels",
    "HalvesDisagree",
    "HandMovesNothing",
    "HandWhereNobodyIs",
    "LabelledElsewhere",
    "Level",
    "ManyDoubts",
    "MotionUnexplained",
    "MotionUnseen",
    "MovesWithDoubted",
    "NeverRests",
    "NoSurface",
    "NoUncertainty",
    "NothingArticulated",
    "OfPart",
    "OfRecording",
    "PivotUnsure",
    "RangeUnsure",
    "Reason",
    "SeenThrough",
    "SmallSurface",
    "StatedReason",
    "StaticSeenThrough",
    "SurfaceContradicted",
    "SurfaceUnseen",
    "TooShort",
    "TracksDisagree",
    "Unexplained",
    "UpUnsure",
    "Verdict",
    "WithinDrift",
    "of_twin",
    "unjudged",
    "verdict_document",
    "verdict_from",
    "verdict_line",
    "worst",
]
