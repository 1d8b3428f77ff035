"""The verb `twin robots`. Only `twin.cli.main` uses this module."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from robots.model.catalog import fetch, names, resolve
from robots.model.kinematics import read_chain
from robots.model.mjcf import compiled
from robots.model.skin import find_skin
from robots.model.spec import RobotSpec
from twin.cli.console import Console, Outcome
from twin.errors import InputError
from twin.report.sections import Table


def robots(console: Console, action: str, name: str | None) -> Outcome:
    """List the robots, show one, or fetch a real model."""
    if action == "list":
        return _list()
    if name is None:
        raise InputError(
            f"`twin robots {action}` needs the name of a robot", f"known robots: {', '.join(names())}"
        )
    if action == "show":
        return _show(resolve(name))
    with console.progress() as progress:
        progress("robots", 0.0, f"fetching {name}")
        path = fetch(name)
        progress("robots", 1.0, str(path))
    return Outcome({"robot": name, "model": str(path)}, notes=[f"model: {path}"])


def _list() -> Outcome:
    specs = [resolve(n) for n in names()]
    rows = [[s.name, s.base_kind, str(_arm_count(s)), s.gripper_kind, s.description] for s in specs]
    data = {"robots": {s.name: {"description": s.description, "model": str(s.model)} for s in specs}}
    table = Table("robots", ["name", "base", "joints", "gripper", "what"], rows)
    return Outcome(data, [table], ["your own arm: `twin replay RUN --robot my_arm.toml` (docs/robots.md)"])


def _show(spec: RobotSpec) -> Outcome:
    """Everything the robot file says, and the limits that its model says; reading both checks them."""
    chain = read_chain(compiled(spec), spec)
    rows = []
    for k, joint in enumerate(spec.arm_joints):
        length, force = ("m", "N") if chain.slides[k] else ("rad", "N m")
        rows.append(
            [
                joint,
                f"{chain.lower[k]:.3f} .. {chain.upper[k]:.3f} {length}",
                f"{spec.velocity[k]:.2f} {length}/s",
                f"{spec.effort[k]:.1f} {force}",
                f"{spec.home[k]:.3f}",
            ]
        )
    table = Table(spec.name, ["joint", "range", "velocity", "limit", "home"], rows)
    grip = f"{spec.gripper_kind}, opens {1000 * spec.stroke:.0f} mm, presses {spec.force:.0f} N"
    notes = [
        spec.description,
        f"model: {spec.model}",
        f"base: {spec.base_kind}; gripper: {grip}",
        f"looks: {_looks(spec)}",
    ]
    limits = {"lower": chain.lower.tolist(), "upper": chain.upper.tolist()}
    return Outcome({"robot": _plain(spec) | limits}, [table], notes)


def _looks(spec: RobotSpec) -> str:
    """What the robot wears in films on this machine, or why it wears nothing."""
    try:
        skin = find_skin(spec)
    except InputError as e:
        return f"its own shapes: {e}"
    return "its own shapes" if skin is None else f"visuals from {skin.source.parent}"


def _plain(spec: RobotSpec) -> dict[str, Any]:
    values = {f.name: getattr(spec, f.name) for f in dataclasses.fields(spec)}
    values["model"] = str(spec.model)
    if spec.looks is not None:
        values["looks"] = dataclasses.asdict(spec.looks) | {"folder": str(spec.looks.folder)}
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


def _arm_count(spec: RobotSpec) -> int:
    return len(spec.arm_joints) - len(spec.base_joints)
