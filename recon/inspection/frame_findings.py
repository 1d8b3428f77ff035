"""Faults that single frames and their times show: one type for each cause, which alone writes its text."""

from __future__ import annotations

from dataclasses import dataclass

from recon.inspection.finding import Finding


@dataclass(frozen=True)
class ClockGap(Finding):
    """After `frame` the clock goes on by `step` s, usual is `usual`. count: of gaps; this is the longest."""

    frame: int
    step: float
    usual: float
    count: int

    @property
    def kind(self) -> str:
        return "clock jumps"

    @property
    def value(self) -> str:
        missing = round(self.step / self.usual) - 1
        more = f"; {self.count} gaps in all" if self.count > 1 else ""
        return f"{self.step:.3f} s after frame {self.frame}, as if {missing} frames were missing{more}"

    @property
    def help(self) -> str:
        return (
            "record without dropped frames (faster storage, a lower resolution), or cut the recording there"
        )


@dataclass(frozen=True)
class ClockDoubled(Finding):
    """`count` frames follow the one before at once, first after `frame` by `step` s (usual: `usual`)."""

    frame: int
    step: float
    usual: float
    count: int

    @property
    def kind(self) -> str:
        return "clock repeats itself"

    @property
    def value(self) -> str:
        return f"{self.count} frames, first {1000 * self.step:.1f} ms after frame {self.frame}, usually {1000 * self.usual:.0f} ms"

    @property
    def help(self) -> str:
        return "write the time at which each picture was taken, not saved, and leave out doubled frames"


@dataclass(frozen=True)
class TooSlow(Finding):
    """So many frames per second."""

    fps: float

    @property
    def kind(self) -> str:
        return "few frames per second"

    @property
    def value(self) -> str:
        return f"{self.fps:.1f} per second"

    @property
    def help(self) -> str:
        return "record 15 frames per second or more, or move more slowly; give times in seconds"


@dataclass(frozen=True)
class Stuck(Finding):
    """`count` frames show exactly the picture before them, first `frame`."""

    count: int
    frame: int
    of: int

    @property
    def kind(self) -> str:
        return "pictures stand still"

    @property
    def value(self) -> str:
        return f"{self.count} of {self.of} are copies of the one before, first frame {self.frame}"

    @property
    def help(self) -> str:
        return "leave out repeated frames and keep the others' times"


@dataclass(frozen=True)
class Cut(Finding):
    """Most of the picture changes at once after `frame`, as it does nowhere beside. count: such places in
    all; this is the first."""

    frame: int
    count: int

    @property
    def doubts(self) -> bool:
        return True

    @property
    def kind(self) -> str:
        return "the video is cut"

    @property
    def value(self) -> str:
        more = f", and at {self.count - 1} more place{'s' * (self.count > 2)}" if self.count > 1 else ""
        return f"between frames {self.frame} and {self.frame + 1}{more}"

    @property
    def help(self) -> str:
        return "take the piece that shows the motion, with --start and --end, or record in one go"


@dataclass(frozen=True)
class Blurred(Finding):
    """`share` of the frames are blurred, most of all `frame`, by `sigma` px (standard deviation, of a picture
    640 wide); direction of the motion that blurs it, "" for a lens out of focus."""

    share: float
    frame: int
    sigma: float
    direction: str

    @property
    def kind(self) -> str:
        return "blurred"

    @property
    def value(self) -> str:
        how = f"motion {self.direction}" if self.direction else "out of focus"
        return (
            f"{self.share:.0%} of the frames, most of all frame {self.frame} by {self.sigma:.1f} px ({how})"
        )

    @property
    def help(self) -> str:
        if self.direction:
            return "more light or a shorter exposure (1/100 s or less), slower head and hand"
        return "fix the focus at the distance of the part, clean the lens"


@dataclass(frozen=True)
class OverExposed(Finding):
    """`share` of the picture is saturated in the median frame, `worst` in the worst."""

    share: float
    worst: float

    @property
    def kind(self) -> str:
        return "over-exposed"

    @property
    def value(self) -> str:
        return f"{self.share:.0%} of the picture is white, {self.worst:.0%} in the worst frame"

    @property
    def help(self) -> str:
        return "shorten the exposure and fix it; keep lamps and windows out of view"


@dataclass(frozen=True)
class UnderExposed(Finding):
    """`share` of the picture is black in the median frame, `worst` in the worst."""

    share: float
    worst: float

    @property
    def kind(self) -> str:
        return "under-exposed"

    @property
    def value(self) -> str:
        return f"{self.share:.0%} of the picture is black, {self.worst:.0%} in the worst frame"

    @property
    def help(self) -> str:
        return "more light; fix the exposure on the part"


@dataclass(frozen=True)
class MissingDepth(Finding):
    """Depth is unknown in `whole` of the picture and in `centre` of its middle, in the median frame; far: m,
    what 5 % of the known pixels exceed."""

    whole: float
    centre: float
    far: float

    @property
    def kind(self) -> str:
        return "depth is missing"

    @property
    def value(self) -> str:
        return f"{self.whole:.0%} of the picture, {self.centre:.0%} of its centre; the rest reaches to {self.far:.1f} m"

    @property
    def help(self) -> str:
        return (
            "come as near as the sensor allows, avoid glass, gloss and sunlight, look at surfaces less aslant"
        )


@dataclass(frozen=True)
class OutOfReach(Finding):
    """The nearest 5 % of depth lie `near` m away."""

    near: float

    @property
    def kind(self) -> str:
        return "too far away"

    @property
    def value(self) -> str:
        return f"nothing is nearer than {self.near:.1f} m"

    @property
    def help(self) -> str:
        return "check depth's unit (depth_scale in intrinsic.json; 1000 for millimetres); else come nearer"


@dataclass(frozen=True)
class TooNear(Finding):
    """95 % of depth are nearer than `far` m."""

    far: float

    @property
    def kind(self) -> str:
        return "too near"

    @property
    def value(self) -> str:
        return f"nothing is farther than {self.far:.2f} m"

    @property
    def help(self) -> str:
        return "check depth's unit (depth_scale in intrinsic.json; 1000 for millimetres); else step back"


@dataclass(frozen=True)
class Small(Finding):
    """Pictures of so few pixels."""

    width: int
    height: int

    @property
    def kind(self) -> str:
        return "small pictures"

    @property
    def value(self) -> str:
        return f"{self.width}x{self.height}"

    @property
    def help(self) -> str:
        return "record 640x480 or more"
