"""Configuration: what is written is read back, what is wrong is named, and what settings were called before
is understood."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from twin.errors import ConfigError
from twin.runs.setting import Settings, group, setting
from twin.runs.settings import as_dict, from_dict, load_config, to_toml


@dataclass(frozen=True)
class Inner(Settings):
    window: int = setting(5, "that is compared", unit="frames", at_least=1)
    scale: float = setting(0.5, "of everything", unit="", above=0, below=1e6)
    mode: Literal["fast", "exact"] = setting("fast", "how")


@dataclass(frozen=True)
class Span(Settings):
    """A condition between two fields, a tuple with elements in a range, infinity."""

    low: float = setting(0.0, "one end", unit="m", at_least=0)
    high: float = setting(1.0, "the other", unit="m", at_least=0, infinite=True)
    gates: tuple[float, ...] = setting((1.0,), "each round's", unit="m", above=0)
    name: str = setting("a", "what it is called")
    perhaps: int | None = setting(None, "none: as it comes", unit="", at_least=2)
    inner: Inner = group(Inner, "more")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low > self.high:
            raise self.refused("low", "not exceed high")


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
        ("[inner]\nwindw = 1", ["unknown key 'inner.windw'", "did you mean 'inner.window'"]),
        ("zzz = 1", ["unknown key 'zzz'", "known keys: inner"]),
        ("[inner]\nwindow = 1.5", ["inner.window = 1.5", "whole number"]),
        ("[inner]\nwindow = true", ["whole number"]),
        ("[inner]\nscale = 'x'", ["a number"]),
        ("[inner]\nmode = 'slow'", ["'slow'", "'fast', 'exact'"]),
        ("[inner]\nwindow = 0", ["c.toml: inner.window = 0 must be at least 1 frame; the default is 5"]),
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


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"low": -0.5}, "Span.low = -0.5 must be at least 0 m; the default is 0.0"),
        ({"low": math.nan}, "Span.low = nan must be at least 0 m; the default is 0.0"),
        ({"low": math.inf}, "Span.low = inf must be at least 0 m; the default is 0.0"),
        ({"low": True}, "Span.low = True must be a number; the default is 0.0"),
        ({"low": np.float32(-1)}, "Span.low = -1.0 must be at least 0 m; the default is 0.0"),
        ({"low": 10**400}, "Span.low = 1000000000000000000000000000000... must be at least 0 m"),
        ({"low": 2.0}, "Span.low = 2.0 must not exceed high"),
        ({"gates": (1.0, 0.0)}, "Span.gates[1] = 0.0 must be above 0 m; the default is (1.0,)"),
        ({"gates": [1.0]}, "Span.gates = [1.0] must be a tuple; the default is (1.0,)"),
        ({"gates": 1.0}, "Span.gates = 1.0 must be a list; the default is (1.0,)"),
        ({"name": 3}, "Span.name = 3 must be a text; the default is 'a'"),
        ({"perhaps": 1}, "Span.perhaps = 1 must be at least 2; the default is None"),
        ({"perhaps": 2.5}, "Span.perhaps = 2.5 must be a whole number; the default is None"),
        ({"inner": None}, "Span.inner = None must be a table"),
    ],
)
def test_a_value_out_of_range_is_refused_in_one_line(wrong: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigError) as e:
        Span(**wrong)
    assert str(e.value).startswith(line.replace("1000000000000000000000000000000...", f"{10**26}..."))
    assert len(str(e.value)) <= 160


def test_values_on_the_bounds_are_taken() -> None:
    assert Span(0.0, math.inf, (1e-300, 2), perhaps=2).gates == (1e-300, 2)
    assert Span(low=np.float64(1.0), high=1).low == 1.0


def test_the_place_of_a_nested_setting_is_told() -> None:
    with pytest.raises(
        ConfigError, match=r"^--set: inner\.scale = 0\.0 must be above 0 and below 1e\+06; the d"
    ):
        from_dict(Span, {"inner": {"scale": 0}}, "--set")
    with pytest.raises(ConfigError, match=r"^f: low = 3.0 must not exceed high$"):
        from_dict(Span, {"low": 3}, "f")


def test_infinity_is_read_as_json_has_it() -> None:
    assert from_dict(Span, as_dict(Span(high=math.inf))).high == math.inf


def test_nothing_is_warned_of_when_all_is_todays() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert from_dict(Span, as_dict(Span())) == Span()


def test_settings_are_changed_by_name_in_groups_too() -> None:
    before = Span(high=2.0)
    after = before.with_(low=1, gates=[2.0, 3.0], inner={"window": 7})
    assert after == Span(1, 2.0, (2.0, 3.0), inner=Inner(7))
    assert before == Span(high=2.0)
    assert before.with_(inner=Inner(9)).inner == Inner(9)
    assert before.with_(perhaps=3).with_(perhaps=None) == before


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"lwo": 1}, "unknown key 'lwo'; did you mean 'low'?"),
        ({"inner": {"windw": 1}}, "unknown key 'inner.windw'; did you mean 'inner.window'?"),
        ({"inner": {"zoom": 1}}, "unknown key 'inner.zoom'; known keys: window, scale, mode"),
        ({"inner": {"window": 0}}, "inner.window = 0 must be at least 1 frame; the default is 5"),
        ({"inner": 3}, "inner = 3 must be a table"),
        ({"low": 3}, "low = 3 must not exceed high"),
        ({"gates": [0.0]}, "gates[0] = 0.0 must be above 0 m"),
    ],
)
def test_a_change_that_is_not_taken_is_named(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError) as e:
        Span().with_(**changes)
    assert str(e.value).startswith(told)
