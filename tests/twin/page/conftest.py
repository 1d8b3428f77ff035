"""A cabinet's page, and a browser that shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.browser import Tab, browser
from tests.makers.viewer import HOSTILE, pictured
from tests.twin.page.test_page import seen
from twin import report
from twin.page import render
from twin.scene import Twin
from twin.storage import save
from twin.verdict import Reason, Verdict


@pytest.fixture(scope="module")
def twin() -> Twin:
    """A cabinet whose camera saw it, with a reason that holds markup."""
    cabinet = seen(cabinet_twin(), count=60)
    assert cabinet.cameras is not None
    n = len(cabinet.cameras.frames)
    cameras = replace(cabinet.cameras, frames=np.arange(n), times=7.0 + np.arange(n) / 15.0)
    labels = {k: cabinet.labels[5 * k] for k in range(0, n, 4)}
    part = cabinet.parts[0]
    doubted = Verdict((Reason("NoRange", HOSTILE, {}, HOSTILE, "open it wider", "doubtful"),))
    motions = [replace(p.motion, times=7.0 + p.motion.frames / 15.0) for p in cabinet.parts]
    parts = [replace(p, motion=m) for p, m in zip(cabinet.parts, motions, strict=True)]
    parts[0] = replace(parts[0], verdict=doubted, limits_source=HOSTILE)
    assert part.joint.upper > 1
    return replace(cabinet, cameras=cameras, labels=labels, parts=tuple(parts))


@pytest.fixture(scope="module")
def page(twin: Twin, tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("run")
    save(twin, run / "twin")
    report.save_film(run, report.film_frames(twin), pictured)
    return render(run)


@pytest.fixture(scope="module")
def tab(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with browser(tmp_path_factory.mktemp("profile")) as tab:
        tab.size(1400, 1000)
        tab.open(page.as_uri())
        assert tab.run("funtwin.ready") is True
        yield tab
