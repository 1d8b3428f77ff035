"""A part that nothing can touch is refused alone: the others are planned and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robots
from benchmarks.scenes import furniture
from robots.config import PlanConfig
from twin.cli.main import run
from twin.errors import PlanningError
from twin.exporters import complete
from twin.importers import from_mjcf
from twin.scene import Motion, Part, Prismatic, Twin
from twin.storage import save

FAST = PlanConfig(candidates=200, finalists=2, rehearse=False)


def with_button(twin: Twin) -> Twin:
    """The twin with a button (part 3) on its cabinet's side that has a surface and no collision shape."""
    mesh = furniture.mesh_of([furniture.box([0.3, 0.3, 0.6], [0.02, 0.02, 0.02])])
    motion = Motion(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    return replace(
        twin,
        parts=(*twin.parts, Part(3, "button", mesh, Prismatic(np.array([-1.0, 0, 0]), 0.0, 0.005), motion)),
    )


def completed_but_bare(twin: Twin) -> Twin:
    """The twin with all that a simulation needs but the button's shape."""
    whole = complete(with_button(twin))
    return replace(
        whole, parts=tuple(replace(p, collision=()) if p.name == "button" else p for p in whole.parts)
    )


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> Twin:
    """A drawer and a button for which no shape could be made."""
    for module in ("robots.planning.plan.completed", "robots.simulation.replay.completed"):
        monkeypatch.setattr(module, lambda twin, *_: twin)
    return completed_but_bare(furniture.drawer())


def test_a_part_without_a_collision_shape_does_not_keep_the_others_from_being_replayed(bare: Twin) -> None:
    trajectory = robots.plan(bare, "part", config=FAST)
    report = robots.replay(bare, trajectory, video=False)
    assert report.ok, report.reason


def test_a_part_that_nothing_can_touch_is_refused_in_the_words_of_its_user(bare: Twin) -> None:
    with pytest.raises(
        PlanningError, match="part 'button' has no collision shape, so no gripper can touch it"
    ) as told:
        robots.plan(bare, "button", contact=np.array([0.31, 0.3, 0.6]), config=FAST)
    assert "robots." not in str(told.value), "no Python in a sentence for people"
    assert "twin.json" in str(told.value)


def test_buttons_without_shapes_in_the_hull_of_an_oven_keep_no_door_from_being_replayed(
    tmp_path: Path,
) -> None:
    """What is made for them lies in what the file states of the oven, whole."""
    path = tmp_path / "oven.xml"
    buttons = "".join(
        f"""<body name="button_{k}" pos="{0.05 * k} -.301 .95"><joint name="press_{k}" type="slide" axis="0 1 0" range="0 .005"/>
        <geom type="box" size=".01 .004 .01" contype="0" conaffinity="0" density="100"/></body>"""
        for k in range(3)
    )
    path.write_text(
        f"""<mujoco model="oven"><compiler angle="radian"/><worldbody><geom type="box" size="2 2 .01" pos="0 -1 -.01"/>
        <body name="oven" pos="0 0 .5"><geom type="box" size=".3 .3 .12" pos="0 -.01 .4"/><geom type="box" size=".3 .28 .3"/></body>
        <body name="door" pos="0 -.302 .5"><joint name="hinge" type="hinge" axis="1 0 0" pos="0 0 -.3" range="0 1.2"/>
          <geom type="box" size=".29 .015 .25" density="200"/><geom type="box" size=".2 .008 .008" pos="0 -.06 .2"/>
          <geom type="box" size=".008 .025 .008" pos=".18 -.035 .2"/><geom type="box" size=".008 .025 .008" pos="-.18 -.035 .2"/></body>
        {buttons}</worldbody></mujoco>""",
        encoding="utf-8",
    )
    twin = from_mjcf(path)
    assert ("static", "button_0") in twin.filtered_pairs
    ready = robots.completed(twin)
    assert all(p.collision for p in ready.parts)
    save(twin, tmp_path / "run" / "twin")
    assert run(["export", str(tmp_path / "run"), "--format", "mjcf"]) == 0
    trajectory = robots.plan(ready, "door", config=FAST)
    assert trajectory.grasp.startswith("bar")
