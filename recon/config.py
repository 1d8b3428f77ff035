"""All settings of a reconstruction: frozen dataclasses per stage for `twin.runs.settings.load_config`."""

from __future__ import annotations

from dataclasses import dataclass

from recon.cameras.poses import CameraConfig
from recon.contact.find_contact import ContactConfig
from recon.fusion.fuse import FusionConfig
from recon.interaction.joints.config import JointConfig
from recon.interaction.labels.label_frames import LabelConfig
from recon.interaction.parts.config import MotionConfig
from recon.recording.said import Said
from recon.texture.photo_textures import TextureConfig
from recon.tracking.follow import TrackConfig
from twin.runs.setting import Settings, group


@dataclass(frozen=True)
class ReconConfig(Settings):
    """Settings by stage; the defaults are meant for every recording."""

    tracks: TrackConfig = group(TrackConfig, "corners followed through the recording")
    cameras: CameraConfig = group(CameraConfig, "camera poses")
    motion: MotionConfig = group(MotionConfig, "which parts move, when and how")
    joints: JointConfig = group(JointConfig, "how tracks or poses become a joint")
    labels: LabelConfig = group(LabelConfig, "what each pixel shows")
    fusion: FusionConfig = group(FusionConfig, "meshes of the static scene and the parts")
    contact: ContactConfig = group(ContactConfig, "where the hand held a part")
    texture: TextureConfig = group(TextureConfig, "photographs on the meshes")
    said: Said = group(Said, "the user's word")
