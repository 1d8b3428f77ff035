"""The inferred layer as a stage: kept and read back it is the same to the byte, with its pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import twin
from benchmarks.scenes.boards import cabinet_twin
from recon.verdict.completion import inferred_layers, with_layers
from tests.makers.runs import twin_bytes
from tests.twin.completion.test_worn import scan
from twin.completion import has_completion, with_completion
from twin.runs.codec import TreeCodec
from twin.scene import Twin
from twin.storage.completion import pieces_texture


@pytest.fixture(scope="module")
def bare() -> Twin:
    return scan()


@pytest.fixture(scope="module")
def whole(bare: Twin) -> Twin:
    return with_completion(bare)


def test_a_layer_that_was_kept_is_the_layer_that_was_inferred(
    bare: Twin, whole: Twin, tmp_path: Path
) -> None:
    (tmp_path / "stage").mkdir()
    TreeCodec().save(inferred_layers(bare), tmp_path / "stage")
    kept = with_layers(bare, TreeCodec().load(tmp_path / "stage"))
    assert has_completion(kept)
    for name, made in (("whole", whole), ("kept", kept)):
        twin.save(made, tmp_path / name / "twin")
    assert twin_bytes(tmp_path / "kept") == twin_bytes(tmp_path / "whole")
    with np.load(tmp_path / "stage" / "arrays.npz") as stored:
        pictures = [
            name for name in stored.files if stored[name].ndim == 3 and stored[name].dtype == np.uint8
        ]
    layers = [whole.static.completion, *(p.completion for p in whole.parts)]
    worn = [k for k in layers if k is not None and pieces_texture(k) is not None]
    assert worn
    assert len(pictures) == len(worn), "the picture of a body's pieces stands once"


def test_a_joint_with_other_limits_gets_another_layer(whole: Twin, tmp_path: Path) -> None:
    (part,) = whole.parts
    twin.save(whole, tmp_path / "twin")
    assert has_completion(twin.load(tmp_path / "twin"))
    longer = replace(part, joint=replace(part.joint, upper=part.joint.upper + 0.02))
    changed = replace(whole, parts=(longer,))
    assert not has_completion(changed)
    (again,) = with_completion(changed).parts
    assert again.completion is not None
    assert again.completion.limits == (longer.joint.lower, longer.joint.upper)


def test_a_twin_that_somebody_stated_has_none() -> None:
    stated = cabinet_twin()
    layers = inferred_layers(stated)
    assert (layers.static, layers.parts) == (None, {})
    assert with_layers(stated, layers) is stated
