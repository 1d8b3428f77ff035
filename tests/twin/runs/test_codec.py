"""Values survive the disk exactly, equal values give equal bytes, and nothing foreign is stored or
imported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twin.runs.codec import CodecError, TreeCodec, decode, encode
from twin.scene import JointSigma, Mesh, Motion, Prismatic, Revolute


def same(a: Any, b: Any) -> bool:
    """Equal structure, types and bits."""
    ta, xa = encode(a)
    tb, xb = encode(b)
    equal_arrays = all(
        xa[k].dtype == xb[k].dtype and xa[k].shape == xb[k].shape and xa[k].tobytes() == xb[k].tobytes()
        for k in xa
    )
    return json.dumps(ta) == json.dumps(tb) and xa.keys() == xb.keys() and equal_arrays


JOINT = Revolute(
    np.array([0.0, 0.6, 0.8]), upper=1.2, pivot=np.array([1, 2, 3.0]), covariance=np.eye(4) * 1e-4
)
VALUES = {
    "scalars": [1, -2.5, 1e-300, True, None, "ü\n"],
    "not finite": (float("nan"), float("inf"), -float("inf")),
    "nested": {"a": {1: (2, [3, ()])}, 7: {}},
    "arrays": {
        "f": np.arange(6, dtype=np.float32).reshape(2, 3),
        "empty": np.zeros((0, 3)),
        "nan": np.array([np.nan]),
    },
    "masks": {k: np.full((80, 90), k, dtype=np.uint8) for k in (0, 255)},
    "joint": JOINT,
    "prismatic": Prismatic(np.array([1.0, 0, 0]), sigma=JointSigma(0.1, None, 0.2)),
    "mesh": Mesh(np.eye(3), np.array([[0, 1, 2]]), np.full((3, 3), 9, dtype=np.uint8)),
    "motion": Motion(np.array([1, 4]), np.array([0.1, 0.2]), np.array([0, 1.0]), intervals=((1, 4),)),
}


@pytest.mark.parametrize("name", VALUES)
def test_round_trip_is_exact(name: str, tmp_path: Path) -> None:
    value, codec = VALUES[name], TreeCodec()
    codec.save(value, tmp_path)
    assert same(codec.load(tmp_path), value)
    assert same(codec.settle(value), value)


def test_types_come_back(tmp_path: Path) -> None:
    TreeCodec().save((JOINT, {3: np.float64(0.5)}), tmp_path)
    joint, numbers = TreeCodec().load(tmp_path)
    assert type(joint) is Revolute
    assert type(numbers[3]) is float


def test_equal_values_give_equal_bytes(tmp_path: Path) -> None:
    for k in "ab":
        (tmp_path / k).mkdir()
        TreeCodec().save(VALUES, tmp_path / k)
    for name in ("data.json", "arrays.npz"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_layout_does_not_matter() -> None:
    """Sums depend on memory order in their last bits, so a value that came from the disk and one that did not
    must lie in memory alike."""
    value = TreeCodec().settle(np.asfortranarray(np.ones((3, 4))))
    assert value.flags.c_contiguous


@pytest.mark.parametrize("value", [object(), {1, 2}, np.array([object()]), lambda: 0, [1, {"a": b"x"}]])
def test_what_can_not_be_stored_is_refused(value: Any) -> None:
    with pytest.raises(CodecError, match="can't be stored"):
        encode(value)


@pytest.mark.parametrize(
    "name", ["os:system", "subprocess:Popen", "twin.runs.codec:json", "twin.scene:Mesh.area"]
)
def test_no_foreign_class_is_built(name: str) -> None:
    with pytest.raises(CodecError):
        decode({"__kind__": "object", "class": name, "data": {}}, {})


def test_laws_are_checked_again_on_load(tmp_path: Path) -> None:
    TreeCodec().save(JOINT, tmp_path)
    text = (tmp_path / "data.json").read_text().replace('"upper": 1.2', '"upper": -1.0')
    (tmp_path / "data.json").write_text(text)
    with pytest.raises(Exception, match="lower <= upper"):
        TreeCodec().load(tmp_path)


@pytest.mark.parametrize("file", ["data.json", "arrays.npz"])
@pytest.mark.parametrize("keep", [0, 30])
def test_damage_is_named(file: str, keep: int, tmp_path: Path) -> None:
    TreeCodec().save(VALUES, tmp_path)
    (tmp_path / file).write_bytes((tmp_path / file).read_bytes()[:keep])
    with pytest.raises(CodecError, match=tmp_path.name):
        TreeCodec().load(tmp_path)
