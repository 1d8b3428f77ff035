"""Makes a folder that is laid out as a checkout of MuJoCo Menagerie: its body names, joints and frames, and
small meshes of our own.

The frames are those of franka_emika_panda/panda.xml and boston_dynamics_spot/spot_arm.xml; what hangs in them
is not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from robots.model.spec import RobotSpec
from twin import geometry as geo

ROOT2 = float(np.sqrt(0.5))
BACK, FORTH = (ROOT2, -ROOT2, 0, 0), (ROOT2, ROOT2, 0, 0)
PLAIN = (1, 0, 0, 0)
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)

NAMES = ("franka", "spot")


def only_checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder that the user names as their checkout; nothing else is on the machine."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    monkeypatch.setenv("FUNTWIN_MENAGERIE", str(folder))
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "none"))
    return folder


def moved(x: float = 0.0, degrees: float = 0.0, axis: object = (0, 0, 1)) -> np.ndarray:
    """A rigid move: x metres along x, turned about an axis."""
    return geo.make_pose(geo.exp_so3(np.deg2rad(degrees) * np.asarray(axis, dtype=float)), [x, 0, 0])


@dataclass(frozen=True)
class Link:
    """A body, what carries it, where, and the joint that moves it."""

    name: str
    parent: str
    pos: tuple[float, float, float] = (0, 0, 0)
    quat: tuple[float, float, float, float] = PLAIN
    joint: str = ""
    axis: tuple[int, int, int] = Z
    kind: str = "hinge"
    visuals: int = 2


PANDA = (
    Link("link0", ""),
    Link("link1", "link0", (0, 0, 0.333), joint="joint1"),
    Link("link2", "link1", quat=BACK, joint="joint2"),
    Link("link3", "link2", (0, -0.316, 0), FORTH, "joint3"),
    Link("link4", "link3", (0.0825, 0, 0), FORTH, "joint4"),
    Link("link5", "link4", (-0.0825, 0.384, 0), BACK, "joint5"),
    Link("link6", "link5", quat=FORTH, joint="joint6"),
    Link("link7", "link6", (0.088, 0, 0), FORTH, "joint7"),
    Link("link8", "link7", (0, 0, 0.107), visuals=0),
    Link("hand", "link8", quat=(0.9238795, 0, 0, -0.3826834)),
    Link("left_finger", "hand", (0, 0, 0.0584), joint="finger_joint1", axis=Y, kind="slide"),
    Link("right_finger", "hand", (0, 0, 0.0584), (0, 0, 0, 1), "finger_joint2", Y, "slide"),
)
LEGS = (("fl", 1, 1), ("fr", 1, -1), ("hl", -1, 1), ("hr", -1, -1))
SPOT = (
    Link("body", "", (0, 0, 0.75), kind="free", joint="freejoint"),
    *(
        link
        for leg, front, left in LEGS
        for link in (
            Link(f"{leg}_hip", "body", (0.29785 * front, 0.055 * left, 0), joint=f"{leg}_hx", axis=X),
            Link(f"{leg}_uleg", f"{leg}_hip", (0, 0.1108 * left, 0), joint=f"{leg}_hy", axis=Y),
            Link(f"{leg}_lleg", f"{leg}_uleg", (0.025, 0, -0.32), joint=f"{leg}_kn", axis=Y),
        )
    ),
    Link("arm_link_sh0", "body", (0.292, 0, 0.188), joint="arm_sh0"),
    Link("arm_link_sh1", "arm_link_sh0", joint="arm_sh1", axis=Y),
    Link("arm_link_hr0", "arm_link_sh1", visuals=0),
    Link("arm_link_el0", "arm_link_hr0", (0.3385, 0, 0), joint="arm_el0", axis=Y),
    Link("arm_link_el1", "arm_link_el0", (0.4033, 0, 0.075), joint="arm_el1", axis=X),
    Link("arm_link_wr0", "arm_link_el1", joint="arm_wr0", axis=Y),
    Link("arm_link_wr1", "arm_link_wr0", joint="arm_wr1", axis=X),
    Link("arm_link_fngr", "arm_link_wr1", (0.11745, 0, 0.01482), joint="arm_f1x", axis=Y),
)
LINKS = {"franka": PANDA, "spot": SPOT}


@dataclass(frozen=True)
class Changes:
    """How the checkout differs from what it should be.

    frames: body -> pose (4, 4) of its new frame in its old one; joints, shapes and children stay where they
    are. moved: body -> pose (4, 4), in its frame, where it is instead with all that hangs on it. joints: name
    -> new name. backwards, slides: joints that go the other way, or slide where they should turn. body: MJCF
    text that is added to the first body.
    """

    frames: Mapping[str, np.ndarray] = field(default_factory=dict)
    moved: Mapping[str, np.ndarray] = field(default_factory=dict)
    joints: Mapping[str, str] = field(default_factory=dict)
    backwards: tuple[str, ...] = ()
    slides: tuple[str, ...] = ()
    body: str = ""


def write_checkout(root: Path, spec: RobotSpec, changes: Changes | None = None) -> Path:
    """Write the model that the robot's [looks] names below `root`; returns its file."""
    assert spec.looks is not None
    file = root / spec.looks.model
    (file.parent / "assets").mkdir(parents=True)
    links = LINKS[spec.name]
    names = [f"{link.name}_{k}" for link in links for k in range(link.visuals)]
    for k, name in enumerate(names):
        unit = 1000 if k % 2 else 1
        (file.parent / "assets" / f"{name}.obj").write_text(wedge(unit * (0.05 + 0.001 * k)))
    meshes = "".join(
        f'<mesh file="{name}.obj"{" scale=" + chr(34) + "0.001 0.001 0.001" + chr(34) if k % 2 else ""}/>'
        for k, name in enumerate(names)
    )
    file.with_name("parts.xml").write_text(
        f'<mujocoinclude><asset><material name="shell" rgba="0.1 0.8 0.2 1"/>'
        f'<material class="theirs" name="trim" rgba="0.9 0.1 0.7 1"/>{meshes}</asset></mujocoinclude>'
    )
    file.write_text(
        f"""<mujoco model="theirs"><compiler angle="radian" meshdir="assets" autolimits="true"/>
        <default><default class="theirs"><material specular="0.25"/>
          <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
          <default class="collision"><geom type="box" size="0.02 0.02 0.02" group="3"/></default>
        </default></default>
        <include file="parts.xml"/>
        <worldbody><geom type="plane" size="1 1 0.1" contype="0" conaffinity="0"/>
        {body_text(links[0], links, changes or Changes())}</worldbody></mujoco>"""
    )
    return file


def body_text(link: Link, links: tuple[Link, ...], changes: Changes) -> str:
    """MJCF of a link and all that it carries."""
    frame = changes.frames.get(link.name, np.eye(4))
    above = geo.invert_pose(changes.frames.get(link.parent, np.eye(4)))
    old = geo.make_pose(geo.matrix_from_quat_wxyz(link.quat), link.pos)
    pose = above @ old @ changes.moved.get(link.name, np.eye(4)) @ frame
    back = geo.invert_pose(frame)
    joint = ""
    if link.joint:
        name = changes.joints.get(link.joint, link.joint)
        way = -1 if link.joint in changes.backwards else 1
        limits = (
            ""
            if link.kind == "free"
            else f' axis="{text(back[:3, :3] @ link.axis * way)}" pos="{text(back[:3, 3])}"'
        )
        kind = "slide" if link.joint in changes.slides else link.kind
        joint = f'<joint name="{name}" type="{kind}"{limits}/>'
    shapes = ""
    for k in range(link.visuals):
        at = back @ geo.make_pose(geo.exp_so3([0.3 * k, 0.2, 0.1]), [0.01, 0.02 * k, 0.03])
        where = f'pos="{text(at[:3, 3])}" quat="{text(geo.quat_wxyz_from_matrix(at[:3, :3]))}"'
        material = "trim" if k else "shell"
        shapes += f'<geom class="visual" mesh="{link.name}_{k}" material="{material}" {where}/>'
    carried = "".join(body_text(c, links, changes) for c in links if c.parent == link.name)
    added = "" if link.parent else changes.body
    return (
        f'<body name="{link.name}" childclass="theirs" pos="{text(pose[:3, 3])}" '
        f'quat="{text(geo.quat_wxyz_from_matrix(pose[:3, :3]))}">{joint}'
        f'<inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>{shapes}'
        f'<geom class="collision"/>{added}{carried}</body>'
    )


def text(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values)


def wedge(size: float) -> str:
    """A tetrahedron without symmetry, as OBJ."""
    corners = size * np.array([[0, 0, 0], [1.0, 0, 0], [0, 0.7, 0], [0.1, 0.2, 0.5]])
    lines = [f"v {text(c)}" for c in corners]
    return "\n".join([*lines, "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]) + "\n"
