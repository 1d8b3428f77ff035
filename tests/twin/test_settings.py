"""Configuration: what is written is read back, and what is wrong is named."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from twin.errors import ConfigError
from twin.runs.settings import as_dict, from_dict, load_config, to_toml


@dataclass(frozen=True)
class Inner:
    window: int = 5
    scale: float = 0.5
    mode: Literal["fast", "exact"] = "fast"

    def __post_init__(self) -> None:
        if self.window < 1:
            raise ConfigError(f"inner.window = {self.window} is not allowed", "use 1 or more")


@dataclass(frozen=True)
class Outer:
    inner: Inner = Inner()
    names: tuple[str, ...] = ()
    size: tuple[int, int] = (1, 2)
    limit: float | None = None
    path: Path = Path("a")
    flag: bool = False
    other: Inner = field(default_factory=Inner)


CHANGED = Outer(Inner(9, 1e-7, "exact"), ("a", 'q"\\'), (3, 4), 2.5, Path("b/c"), True, Inner(2))


@pytest.mark.parametrize("config", [Outer(), CHANGED])
def test_toml_round_trip(config: Outer, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert load_config(Outer, path) == config


def test_dict_round_trip() -> None:
    assert from_dict(Outer, as_dict(CHANGED)) == CHANGED


def test_missing_keys_keep_their_defaults(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text("[inner]\nwindow = 7\n")
    assert load_config(Outer, tmp_path / "c.toml") == Outer(Inner(window=7))


def test_whole_numbers_are_numbers() -> None:
    scale = from_dict(Inner, {"scale": 2}).scale
    assert scale == 2.0
    assert type(scale) is float


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[iner]\nwindow = 1", ["unknown key 'iner'", "did you mean 'inner'"]),
        ("[inner]\nwindw = 1", ["inner: unknown key 'windw'", "did you mean 'window'"]),
        ("zzz = 1", ["unknown key 'zzz'", "known keys: inner"]),
        ("[inner]\nwindow = 1.5", ["inner: window = 1.5", "whole number"]),
        ("[inner]\nwindow = true", ["whole number"]),
        ("[inner]\nscale = 'x'", ["a number"]),
        ("[inner]\nmode = 'slow'", ["'slow'", "'fast', 'exact'"]),
        ("[inner]\nwindow = 0", ["inner.window = 0", "1 or more"]),
        ("inner = 3", ["must be a table"]),
        ("size = [1]", ["must hold 2 values, got 1"]),
        ("names = ['a', 2]", ["names[1] = 2", "a text"]),
        ("limit = 'x'", ["a number"]),
        ("flag = 1", ["true or false"]),
        ("flag = ", ["not readable TOML"]),
    ],
)
def test_errors_name_key_value_and_remedy(text: str, words: list[str], tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(ConfigError) as e:
        load_config(Outer, tmp_path / "c.toml")
    for word in words:
        assert word in str(e.value)
    assert "\n" not in str(e.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml does not exist"):
        load_config(Outer, tmp_path / "nowhere.toml")
