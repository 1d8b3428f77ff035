"""What a joint fit returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.interaction.joints.type_selection import TypeEvidence
from twin.describe import joint_text
from twin.geometry import Array
from twin.scene import Motion, Prismatic, Revolute


@dataclass(frozen=True, eq=False, repr=False)
class MotionFit:
    """A joint with the motion that showed it.

    joint: state 0 is the first rest pose, positive along the net motion; limits, covariance and sigma filled.
    The pivot is the axis point nearest the part's tracks. frames (n,), state (n,) m or rad, state_sigma (n,):
    frames with an estimate only. residual: m, RMS over the observations that agree. inliers: share of the
    moving evidence that agrees. track_inliers (K,): tracks that are rigid with the part. landmarks (K, 3):
    their points at state 0, NaN for others. evidence, type_source: why this type. residual_rad: RMS of the
    rotations, known when poses were fitted; it has no tracks: `track_inliers` and `landmarks` are empty.
    """

    joint: Prismatic | Revolute
    frames: NDArray[np.int64]
    state: Array
    state_sigma: Array
    residual: float
    inliers: float
    track_inliers: NDArray[np.bool_]
    landmarks: Array
    evidence: TypeEvidence
    type_source: str
    residual_rad: float | None = None

    def __repr__(self) -> str:
        seen = (
            f"{len(self.frames)} frames, {int(self.track_inliers.sum())} of {len(self.track_inliers)} tracks"
        )
        return f"<MotionFit: {joint_text(self.joint)}; {seen}, residual {1000 * self.residual:.2g} mm>"

    def motion(self, times: ArrayLike, intervals: tuple[tuple[int, int], ...] = ()) -> Motion:
        """The motion as a twin stores it. times (T,): seconds of all recording frames."""
        clock = np.asarray(times, dtype=np.float64)
        return Motion(self.frames, clock[self.frames], self.state, intervals, self.residual, self.inliers)
