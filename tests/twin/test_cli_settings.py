"""Settings of a verb: from a file, from the command line, and what is wrong with them in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.twin.stand_ins import Nested, Settings
from twin.cli import given
from twin.errors import ConfigError


def test_settings_come_from_file_and_command_line(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text("[labels]\nseed = 3\nname = 'b'\n")
    got = given.settings(
        Nested, tmp_path / "c.toml", ["labels.seed=4", "labels.sizes=[1, 2]", "labels.name=word"]
    )
    assert got == Nested(Settings(4, "word", (1, 2)))
    assert given.settings(Settings, None, []) == Settings()


@pytest.mark.parametrize(
    ("assignments", "words"),
    [
        (["seed"], "'seed' is not KEY=VALUE"),
        (["sed=1"], "did you mean 'seed'"),
        (["seed=x"], "seed = 'x' must be a whole number"),
        (["seed=1", "seed.x=1"], "'seed' is a value, not a table"),
    ],
)
def test_wrong_settings_are_named(assignments: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        given.settings(Settings, None, assignments)


def test_missing_settings_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no\.toml does not exist"):
        given.settings(Settings, tmp_path / "no.toml", [])
