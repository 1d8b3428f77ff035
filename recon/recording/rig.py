"""Two cameras on one device: the lens of each, and where the depth camera stands beside the colour camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from recon.recording import Intrinsics
from twin.errors import InputError
from twin.geometry import Array

# OpenCV's counts of coefficients: none, k1 k2 p1 p2, with k3, with k4 k5 k6, with thin prism, with tilt.
DISTORTION_COUNTS = (0, 4, 5, 8, 12, 14)


@dataclass(frozen=True)
class Lens:
    """A camera as its pictures are stored.

    camera: pinhole part, pixel centres at integers. distortion: OpenCV's coefficients in its order k1 k2 p1
    p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]], empty for none.
    """

    camera: Intrinsics
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) not in DISTORTION_COUNTS or not np.all(np.isfinite(self.distortion)):
            raise InputError(
                f"a lens has {len(self.distortion)} distortion coefficients: {self.distortion}",
                f"give {', '.join(map(str, DISTORTION_COUNTS))} finite numbers in OpenCV's order k1 k2 p1 p2 k3 ...",
            )

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines are straight in its pictures."""
        return not any(self.distortion)

    def scaled(self, width: int, height: int) -> Lens:
        """The same lens at another resolution; its coefficients have no unit."""
        return Lens(self.camera.scaled(width, height), self.distortion)


@dataclass(frozen=True, eq=False)
class Rig:
    """A colour and a depth camera.

    T_color_depth (4, 4): takes points of the depth camera to the colour camera, m. along_ray: depth is the
    distance along each pixel's ray instead of along the view.
    """

    color: Lens
    depth: Lens
    T_color_depth: Array = field(default_factory=lambda: np.eye(4))
    along_ray: bool = False

    @classmethod
    def one(cls, camera: Intrinsics) -> Rig:
        """Depth that lies on colour pixel by pixel, without distortion."""
        return cls(Lens(camera), Lens(camera))

    @property
    def is_registered(self) -> bool:
        """Whether depth lies on colour pixel by pixel as it is stored, and neither is distorted."""
        return (
            self.color.camera == self.depth.camera
            and self.color.is_pinhole
            and self.depth.is_pinhole
            and not self.along_ray
            and np.array_equal(self.T_color_depth, np.eye(4))
        )
