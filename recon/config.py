"""All settings of a reconstruction: one frozen dataclass per stage, read from TOML by `twin.runs.settings.load_config`."""

from __future__ import annotations

from dataclasses import dataclass, field

from recon.cameras.gravity import GravityConfig
from recon.cameras.poses import CameraConfig
from recon.contact.closed_end import ClosedEndConfig
from recon.contact.find_contact import ContactConfig
from recon.fusion.fuse import FusionConfig
from recon.joints.config import JointConfig
from recon.labels.label_frames import LabelConfig
from recon.parts.config import MotionConfig
from recon.refine.observations import RefineConfig
from recon.tracking.tracks import TrackConfig


@dataclass(frozen=True)
class ReconConfig:
    """Settings by stage; the defaults are meant for every recording."""

    tracks: TrackConfig = field(default_factory=TrackConfig)
    cameras: CameraConfig = field(default_factory=CameraConfig)
    gravity: GravityConfig = field(default_factory=GravityConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    joints: JointConfig = field(default_factory=JointConfig)
    refine: RefineConfig = field(default_factory=RefineConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    closed_end: ClosedEndConfig = field(default_factory=ClosedEndConfig)
    contact: ContactConfig = field(default_factory=ContactConfig)
