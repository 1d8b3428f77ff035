"""README.md of every exported folder: what is in it and what a reader must know."""

from __future__ import annotations

from twin.exporters.tree import Tree, clear_of_each_other
from twin.names import scene_file

_PASSIVE = """Its joints are passive. Isaac Sim's URDF importer makes every joint a position servo, which holds a door
shut: choose no target for the joint drives when you import, or set their stiffness to 0 afterwards."""


def readme(tree: Tree, fmt: str) -> str:
    """The text for format urdf, mjcf, usd or glb."""
    body = {"urdf": _urdf, "mjcf": _mjcf, "usd": _usd, "glb": _glb, "rrd": _rrd}[fmt](tree)
    rows = ["| joint | type | lower | upper | damping | friction loss |", "|---|---|---|---|---|---|"]
    for link in tree.moving:
        j = link.joint
        if j is not None:
            unit = ("rad", "N m s/rad", "N m") if j.kind == "revolute" else ("m", "N s/m", "N")
            cells = [f"{v:.4g} {u}" for v, u in zip(
                (j.lower, j.upper, j.damping, j.frictionloss), (unit[0], *unit), strict=True)]  # fmt: skip
            rows.append(f"| {j.name} | {j.kind} | {' | '.join(cells)} |")
    told = "Metres, kilograms, seconds, radians; z up. Every joint is closed at 0 and opens towards its upper limit."
    layers = f"{_layers(tree, fmt)}\n\n" if tree.whole else ""
    table = "\n".join(rows) + "\n" + _catches(tree, fmt)
    return f"# {tree.name}\n\n{_verdict(tree)}\n\n{body}\n\n{layers}{told}\n\n{table}"


def _catches(tree: Tree, fmt: str) -> str:
    """What holds closed parts beside friction, and what the format does of it; empty without catches."""
    caught = [k.joint for k in tree.moving if k.joint is not None and k.joint.catch is not None]
    done = {
        "urdf": "URDF has no word for it: it stands in a comment and in asset.json, and no program simulates it.",
        "mjcf": "MuJoCo 3.11 and later simulate it: a contact that pulls, between two geoms that touch nothing else (`<pair adhesion>`).",
        "usd": "No schema has a word for it: it stands in the joint's custom data `catch` and in asset.json, and no program simulates it.",
        "glb": "glTF has no word for it: it stands in asset.json.",
        "rrd": "Rerun has no word for it: it stands in asset.json.",
    }[fmt]
    return "".join(f"\n- {j.name}: {j.caught}. {done}" for j in caught) + ("\n" if caught else "")


def _layers(tree: Tree, fmt: str) -> str:
    """What a reader must know of the inferred layer."""
    pieces = [(k, v) for k in tree.links for v in k.visuals if v.basis != "seen"]
    assumed = sum(v.basis == "assumed" for _, v in pieces)
    where = {
        "urdf": "visuals `<link>_inferred_<piece>`, each under a comment with its reason",
        "mjcf": f"geoms `<body>_inferred_<piece>` of the classes `{tree.name}_evidence` and `{tree.name}_assumed`, reasons under `custom`",
        "glb": "nodes `<link>_inferred_<piece>` with `extras` (basis, role, reason)",
        "rrd": "entities `<link>_inferred_<piece>`",
        "usd": "prims `<body>_inferred_<piece>` with the custom data `inferred` (basis, reason) and a semantic label",
    }[fmt]
    stands = f"What a camera saw and what is inferred stand apart. Inferred are {len(pieces)} pieces, {assumed} of them assumed"
    lines = [
        f"{stands} (nothing that was seen bounds them): {where}.",
        "`asset.json` says which layer is shown, and `T_asset_twin`: from the twin's world, in which robots' trajectories are, into this one.",
    ]
    if any(k.regions for k in tree.links) and fmt in ("mjcf", "usd"):
        sites = (
            " are sites (a box to place things in, and a point on its floor)"
            if fmt == "mjcf"
            else " are frames with their `size`"
        )
        lines.append(f"`<body>_..._region`{' and `..._spawn`' if fmt == 'mjcf' else ''}{sites}.")
    if fmt == "usd":
        lines.append(
            "Shapes are in `<body>/visuals` and `<body>/collisions`, which are instances: copies of the asset share them, and programs find their "
            "prims with `Usd.TraverseInstanceProxies()`. A material that you bind to one of the two, stronger than descendants, replaces those inside."
        )
    if fmt == "mjcf":
        lines.append("Sensors `<joint>_pos` and `<joint>_vel`.")
    return " ".join(lines)


def _verdict(tree: Tree) -> str:
    """The verdict on the twin and all reasons for it; of a twin without a verdict what that means."""
    if tree.verdict is None or tree.verdict.trusted:
        return f"{tree.told[:1].upper()}{tree.told[1:]}."
    rows = [f"- {r.level}: {r.text}; {r.help}" for r in tree.verdict.reasons]
    return "\n".join([f"Verdict: **{tree.verdict.level}**", "", *rows])


def _urdf(tree: Tree) -> str:
    return f"""`{tree.name}.urdf` with `meshes/`: visual OBJ with texture, one convex OBJ or box per collision element. The link
`world` carries the static scene by a fixed joint; the scene's mass has no effect.

- {_PASSIVE.replace(chr(10), chr(10) + "  ")}
- URDF has no contact friction, no pairs that must not collide and no stored poses: set friction in the simulator;
  {clear_of_each_other(tree)}.
- `<part>_grasp` are frames without mass: x along the closing direction of a gripper, y along the handle, z out of the part.
- Effort and velocity limits are placeholders far above what a hand does. MuJoCo's own `<mujoco>` element keeps the static
  link and the visuals there; other readers skip it.
- PyBullet: load with `URDF_USE_INERTIA_FROM_FILE`. SAPIEN ignores joint friction of URDF; set it after loading.
- With `twin export --package NAME` this folder is the ROS package NAME, and `urdf/{tree.name}.urdf` uses package:// paths."""


def _mjcf(tree: Tree) -> str:
    return f"""`{scene_file(tree.name)}` is `{tree.name}.xml` with floor and light; include or attach `{tree.name}.xml` into your own scene.

- Keyframes `closed` and `open`; sites `<part>_grasp` (x along the closing direction of a gripper, y along the handle, z out
  of the part); visual geoms in group 2, collision geoms in group 3.
- Parts do not collide with what they are mounted on (`<exclude>`): hinges and runners are not modelled as contact.
- Each joint has armature, a hundredth of its part's inertia about it: too little to be felt."""


def _glb(tree: Tree) -> str:
    return f"""`{tree.name}.glb` is to be looked at, in a browser, in Blender or in a game engine; nothing in it is simulated.

- Each link is a node of its name, at its joint; the node's `extras` have the joint: name, type, axis, limits and unit.
- A part opens by its node's rotation about the axis, or its translation along it, from where the node stands.
- Animations: `open`, all parts from closed to open and back, and `recorded`, the states of the recording, in seconds
  from its first camera.
- glTF is y up: the first node turns the twin, whose own axes are z up below it."""


def _rrd(tree: Tree) -> str:
    return f"""`{tree.name}.rrd` is to be looked at with Rerun: `rerun {tree.name}.rrd`, of the package's version or later.

- `world/<root>/<part>` moves over `time`, in seconds from the recording's first camera; its axis stands beside it.
- `world/camera` has the recording's pictures, the labels and the tracks of each; `states/<part>` is in degrees or mm."""


def _usd(tree: Tree) -> str:
    return f"""`{tree.name}.usda` is ready for MuJoCo and Newton, `{tree.name}_physx.usda` for Isaac Sim (PhysX). Both only refer to the
asset `{tree.name}/simready_usd/{tree.name}.usda`, which your own scenes should refer to as well.

- The asset is plain UsdPhysics, which has no passive damping or friction of joints. These come with the variant of a
  runtime, `PhysX`, `Newton` or `MuJoCo`, all `Disabled` until you choose. Enable one only: readers would add up what
  several say.
- In PhysX damping is a joint drive without stiffness: the joint is passive, it does not hold a position.
- Angles of joint limits are in degrees, damping of `Newton` and `PhysX` per degree, of `MuJoCo` per radian.
- `<part>_grasp` are frames (x along the closing direction of a gripper, y along the handle, z out of the part); the variant
  `Grasps` adds lines from finger to finger, which MuJoCo can't compile.
- The static scene is fixed to the world; its mass has no effect."""
