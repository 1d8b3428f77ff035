"""Evidence about a part with one figure altered, all else as it was."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

from recon.verdict.evidence import PartEvidence
from recon.verdict.places import Places
from twin.scene import Joint, Prismatic, Revolute


def with_sigma(e: PartEvidence, **values: float) -> PartEvidence:
    sigma = replace(e.part.joint.sigma, **values)
    return replace(e, part=replace(e.part, joint=replace(e.part.joint, sigma=sigma)))


def with_labels(e: PartEvidence, labels: dict[int, Any]) -> PartEvidence:
    return replace(e, scene=replace(e.scene, labels=labels))


def ranging(e: PartEvidence, span: float, kind: type[Joint] = Revolute) -> PartEvidence:
    """The same range and sigma over a shorter or longer way."""
    joint = e.part.joint
    turned = joint if kind is Revolute else Prismatic(joint.axis, sigma=joint.sigma)
    return replace(e, part=replace(e.part, joint=replace(turned, lower=0.0, upper=span)))


def with_known(e: PartEvidence, **known: Any) -> PartEvidence:
    """The scene's evidence as if it had been computed."""
    scene = copy(e.scene)  # with all that is known of it already
    scene.__dict__.update(known)
    return replace(e, scene=scene)


def with_places(e: PartEvidence, **shares: float) -> PartEvidence:
    """Evidence with these shares of the surface, of one that is known well in all else."""
    out = replace(e)
    vars(out)["places"] = replace(Places(0.8, 1.0), **shares)
    return out


def with_border(e: PartEvidence, share: float) -> PartEvidence:
    """Evidence of which this share of the border at rest is no edge."""
    out = replace(e)
    vars(out)["bare_border"] = (4, share)
    return out


def backed_off(e: PartEvidence, away: float) -> PartEvidence:
    """The cameras of the second half stand so many metres farther back than they were."""
    poses = e.scene.cameras.T_world_cam.copy()
    half = len(poses) // 2
    poses[half:, :3, 3] -= away * poses[half:, :3, 2]
    return replace(e, scene=replace(e.scene, cameras=replace(e.scene.cameras, T_world_cam=poses)))
