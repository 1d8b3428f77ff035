"""Faults that frames show together: one type for each cause, which alone writes its text."""

from __future__ import annotations

from dataclasses import dataclass

from recon.inspection.finding import Finding


@dataclass(frozen=True)
class Misregistered(Finding):
    """Depth lies beside colour by x, y px of the recording (depth to the right of and below colour is
    positive); border: px by which a wrong scale moves the side borders apart besides. None: unknown."""

    x: float | None
    y: float | None
    border: float | None

    @property
    def doubts(self) -> bool:
        return True

    @property
    def kind(self) -> str:
        return "depth does not lie on colour"

    @property
    def value(self) -> str:
        said = [
            f"{abs(v):.1f} px too far {a if v > 0 else b}"
            for v, a, b in ((self.x, "right", "left"), (self.y, "down", "up"))
            if v is not None
        ]
        if self.border is not None:
            said.append(
                f"{abs(self.border):.1f} px too {'wide' if self.border > 0 else 'narrow'} at either border"
            )
        return ", ".join(said)

    @property
    def help(self) -> str:
        return "register depth to colour with the device's own calibration, and check depth_intrinsic.json"


@dataclass(frozen=True)
class NoCommonEdges(Finding):
    """None of `edges` pixels on edges of depth, together, lie on edges of colour within `reach` px."""

    edges: int
    reach: float

    @property
    def doubts(self) -> bool:
        return True

    @property
    def kind(self) -> str:
        return "depth does not lie on colour"

    @property
    def value(self) -> str:
        return f"edges of depth ({self.edges} pixels) meet edges of colour nowhere within {self.reach:.0f} px"

    @property
    def help(self) -> str:
        return "register depth to colour; check that it is not mirrored, turned, or from another moment"


@dataclass(frozen=True)
class DepthDelayed(Finding):
    """Depth lags `lag` s behind colour (ahead: negative), +- sigma; frames: the nearest whole number."""

    frames: int
    lag: float
    sigma: float

    @property
    def doubts(self) -> bool:
        return self.frames != 0

    @property
    def kind(self) -> str:
        return "depth and colour of different times"

    @property
    def value(self) -> str:
        ms = f"{1000 * abs(self.lag):.0f} ± {1000 * self.sigma:.0f} ms"
        n = abs(self.frames)
        told = f"{n} frame{'s' * (n != 1)} ({ms})" if n else f"{ms}, less than half a frame,"
        return f"depth {'lags' if self.lag > 0 else 'is'} {told} {'behind' if self.lag > 0 else 'ahead of'} colour"

    @property
    def help(self) -> str:
        if self.frames:
            return f"open it with --depth-delay {self.frames}, or pair pictures by the times they were taken"
        return "pair pictures by the times they were taken, or let the device synchronise them"


@dataclass(frozen=True)
class WrongFocal(Finding):
    """The tracks fit a focal length of `fitted` px, the recording states `stated`; sigma: of their ratio."""

    stated: float
    fitted: float
    sigma: float

    @property
    def kind(self) -> str:
        return "wrong focal length"

    @property
    def value(self) -> str:
        off = self.stated / self.fitted - 1
        return f"{self.stated:.0f} px is {abs(off):.1%} too {'long' if off > 0 else 'short'}: points move rigidly at {self.fitted:.0f} px"

    @property
    def help(self) -> str:
        return "give the intrinsics of this resolution and of colour; calibrate, and undistort the pictures"


@dataclass(frozen=True)
class NoRest(Finding):
    """Something besides the camera moves in the first (`before`) or last (`after`) `seconds`, by `share`."""

    before: bool
    after: bool
    seconds: float
    share: float

    @property
    def kind(self) -> str:
        when = [w for w, here in (("before", self.before), ("after", self.after)) if here]
        return f"no rest {' or '.join(when)} the motion"

    @property
    def value(self) -> str:
        when = [w for w, here in (("first", self.before), ("last", self.after)) if here]
        return f"{self.share:.1%} of the picture moves in the {' and '.join(when)} {self.seconds:.2f} s"

    @property
    def help(self) -> str:
        return "start recording a second before you reach out, and go on for a second after the hand has left"


@dataclass(frozen=True)
class NothingMoves(Finding):
    """At most `share` of the picture changes by anything but the camera."""

    share: float

    @property
    def kind(self) -> str:
        return "nothing moves"

    @property
    def value(self) -> str:
        return f"at most {self.share:.2%} of the picture changes in {1 / 3:.1f} s"

    @property
    def help(self) -> str:
        return "open the part by hand, in view, by a few degrees or centimetres at least"


@dataclass(frozen=True)
class HandAlwaysThere(Finding):
    """No frame without the hand before or after the motion; share: of the frames in which it is in view."""

    before: bool
    after: bool
    share: float

    @property
    def kind(self) -> str:
        return "hand in every frame" if self.before and self.after else "hand in view"

    @property
    def value(self) -> str:
        when = [w for w, here in (("first", self.before), ("last", self.after)) if here]
        return f"in the {' and '.join(when)} frames, and in {self.share:.0%} of all"

    @property
    def help(self) -> str:
        return "keep the hand out of view for a few frames before and after: they show the part bare"
