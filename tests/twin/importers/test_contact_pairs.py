"""What an MJCF file says of contacts is read: contype, conaffinity, <exclude>, <pair>, parent and child."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.makers.twin.scene_texts import HINGE, LIMIT, urdf
from twin.importers import mjcf as mjcf_reader
from twin.importers import urdf as urdf_reader


def _bodies(rng: np.random.Generator, count: int) -> tuple[str, list[list[str]]]:
    """Nested bodies, all in one place, some welded to what they hang on, and the chain of names of each."""
    chains: list[list[str]] = []
    for k in range(count):
        above = chains[int(rng.integers(len(chains)))] if chains and rng.random() < 0.6 else []
        chains.append([*above, f"b{k}"])
    text = ""
    for chain in sorted(chains):
        bits = rng.integers(0, 4, 2)
        joint = '<joint type="hinge" range="0 1" limited="true"/>' if rng.random() < 0.7 else ""
        geom = f'<geom name="g{chain[-1]}" size="1" contype="{bits[0]}" conaffinity="{bits[1]}"/>'
        text += f"{len(chain)}|<body name='{chain[-1]}'>{joint}{geom}\n"
    made, depth = "", 0
    for line in text.splitlines():
        deep, _, body = line.partition("|")
        made += "</body>" * max(depth - int(deep) + 1, 0) + body
        depth = int(deep)
    return made + "</body>" * depth, sorted(chains)


def _scene(seed: int) -> str:
    rng = np.random.default_rng(seed)
    bodies, chains = _bodies(rng, 7)
    names = [c[-1] for c in chains]
    pairs = [p for p in combinations(names, 2) if rng.random() < 0.1]
    excludes = [p for p in combinations(names, 2) if rng.random() < 0.15]
    contact = "".join(f'<pair geom1="g{a}" geom2="g{b}"/>' for a, b in pairs)
    contact += "".join(f'<exclude body1="{b}" body2="{a}"/>' for a, b in excludes)
    flag = '<option><flag filterparent="disable"/></option>' if rng.random() < 0.3 else ""
    return f"<mujoco>{flag}<worldbody>{bodies}</worldbody><contact>{contact}</contact></mujoco>"


@pytest.mark.parametrize("seed", range(12))
def test_bodies_that_mujoco_never_lets_touch_are_apart_and_no_others(seed: int, tmp_path: Path) -> None:
    """All bodies lie in one place: whatever MuJoCo lets touch, touches."""
    path = tmp_path / "scene.xml"
    path.write_text(_scene(seed))
    source = mjcf_reader.read(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = [[int(model.geom_bodyid[g]) for g in c.geom] for c in data.contact]
    touch = {frozenset(model.body(b).name for b in pair) for pair in bodies}
    solid = [b.name for b in source.bodies if b.collision]
    weld = {n: int(model.body_weldid[model.body(n).id]) for n in solid}
    against = {frozenset(p) for p in combinations(solid, 2) if weld[p[0]] != weld[p[1]]}
    assert source.never_touching == against - touch
    assert source.never_touching


def test_a_geom_that_only_a_pair_lets_touch_is_a_collision_shape(tmp_path: Path) -> None:
    path = tmp_path / "pair.xml"
    geom = '<geom name="{0}" size=".1" contype="0" conaffinity="0"/>'
    door = f'<body name="door"><joint range="0 1" limited="true"/>{geom.format("d")}</body>'
    contact = '<contact><pair geom1="d" geom2="w"/></contact>'
    path.write_text(f"<mujoco><worldbody>{geom.format('w')}{door}</worldbody>{contact}</mujoco>")
    source = mjcf_reader.read(path)
    assert [len(b.collision) for b in source.bodies] == [1, 1]
    assert source.never_touching == frozenset()


def test_urdf_says_nothing_of_contacts(tmp_path: Path) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(urdf(HINGE.format("revolute", LIMIT)))
    assert urdf_reader.read(path).never_touching == frozenset()
