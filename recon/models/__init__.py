"""Learned models that may help a reconstruction: a Protocol for each question, a thin adapter for each model.

None is asked unless the user names it, and what they say is a hint that motion evidence may overrule.
"""

from __future__ import annotations

from pathlib import Path

from recon.models.joint_hint import JointHint, PrecomputedJointHint

__all__ = ["JointHint", "PrecomputedJointHint", "joint_hint"]


def joint_hint(name: str) -> JointHint:
    """The source of hints of that name: "vlm" asks a vision-language model (FUNTWIN_VLM_URL), else JSON."""
    if name == "vlm":
        from recon.models.vlm_joint_hint import VlmJointHint

        return VlmJointHint()
    return PrecomputedJointHint(Path(name))
