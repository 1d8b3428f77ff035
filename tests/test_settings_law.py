"""Law: every settings object, written as TOML and read back, is equal; what can't be written is refused by name."""

from __future__ import annotations

import tomllib
import types
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.config import ReconConfig
from recon.readers import open_recording
from recon.simulate.config import SimulateConfig
from robots.config import PlanConfig, ReplayConfig
from tests.recon import tiny
from twin.collision import CollisionConfig
from twin.errors import ConfigError
from twin.runs.keys import stage_key
from twin.runs.settings import as_dict, from_dict, load_config, to_toml

ROOTS = (ReconConfig, SimulateConfig, PlanConfig, ReplayConfig, CollisionConfig)
# TOML holds 64-bit integers; every character but halves of surrogate pairs, which are no text
INTEGERS = st.integers(-(2**63), 2**63 - 1) | st.integers(-3, 100)
TEXTS = st.text(st.characters(exclude_categories=["Cs"])) | st.text(
    "\"'\\\x00\x1f\x7f\r\n\t\u0085\u2028é😀=[]#"
)
FLOATS = st.floats(allow_nan=False) | st.floats(0, 1) | st.floats(1, 100)


def reachable(cls: type) -> Iterator[type]:
    """The class and the settings classes that it holds."""
    yield cls
    for hint in get_type_hints(cls).values():
        for inner in (hint, *get_args(hint)):
            if isinstance(inner, type) and is_dataclass(inner):
                yield from reachable(inner)


CLASSES = list(dict.fromkeys(c for root in ROOTS for c in reachable(root)))


def values(hint: Any) -> st.SearchStrategy[Any]:
    """Any value of a field's type, numpy's numbers among them."""
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return st.one_of([values(a) for a in args])
    if origin is Literal:
        return st.sampled_from(args)
    if origin is tuple and args[-1] is Ellipsis:
        return st.lists(values(args[0]), max_size=4).map(tuple)
    if origin is tuple:
        return st.tuples(*map(values, args))
    if isinstance(hint, type) and is_dataclass(hint):
        return configs(hint)
    known = {
        int: INTEGERS | INTEGERS.map(np.int64),
        float: FLOATS | FLOATS.map(np.float64) | st.floats(0, 1, width=32).map(np.float32),
        str: TEXTS,
        bool: st.booleans(),
        type(None): st.none(),
        Path: st.text("abc/. é\\", min_size=1).map(Path),
    }
    return known[hint]


def plain(value: Any) -> Any:
    """The value in Python's own numbers."""
    if isinstance(value, tuple):
        return tuple(map(plain, value))
    return value.item() if isinstance(value, np.generic) else value


@st.composite
def configs(draw: st.DrawFn, cls: type) -> Any:
    """Any object of the class: its defaults, with each field changed to what the class takes there."""
    config = in_python = cls()
    for name, hint in get_type_hints(cls).items():
        value = draw(values(hint))
        try:
            # In Python's numbers too, as a file holds them: numpy rounds -1e-308 to float32's -0 before it compares.
            changed, changed_in_python = (
                replace(config, **{name: value}),
                replace(in_python, **{name: plain(value)}),
            )
        except (ConfigError, TypeError, ValueError, OverflowError, RuntimeWarning):
            continue  # the class refuses it, or can't compare a huge float with numpy's float32
        config, in_python = changed, changed_in_python
    return config


def test_a_bound_that_only_float32_would_meet_is_not_drawn() -> None:
    """numpy's 0 in 32 bits equals -1e-308, Python's doesn't: such an object can be made, its file can't be read."""
    bounds = (np.float32(0), -1.1125369292536007e-308)
    PlanConfig(pedestal=bounds)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="pedestal"):
        PlanConfig(pedestal=plain(bounds))


def read_back(config: Any) -> Any:
    return from_dict(type(config), tomllib.loads(to_toml(config)))


@dataclass(frozen=True)
class Row:
    name: str = ""
    limit: float | None = None
    pair: tuple[int, bool] = (0, False)


@dataclass(frozen=True)
class Everything:
    """Every kind of setting, nested as deep as it may be."""

    text: str = "a"
    path: Path = Path("a")
    scale: float = 1.0
    bounds: tuple[float, float] = (0.0, float("inf"))
    choice: Literal["x", "y"] = "x"
    perhaps: int | None = None
    names: tuple[str, ...] = ()
    rows: tuple[Row, ...] = (Row(),)
    grid: tuple[tuple[float, ...], ...] = ((1.0,), ())
    inner: Row = field(default_factory=Row)


@pytest.mark.parametrize("cls", [*CLASSES, Everything], ids=lambda c: c.__name__)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_settings_written_as_toml_are_read_back_equal(cls: type, data: st.DataObject) -> None:
    config = data.draw(configs(cls))
    assert read_back(config) == config


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_the_defaults_are_plain_numbers_in_the_file(cls: type) -> None:
    text = to_toml(cls())
    assert "np." not in text
    assert read_back(cls()) == cls()


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_none_is_only_written_where_it_is_the_default(cls: type) -> None:
    """TOML has no null: a setting that is None is left out, so None must be what it then becomes."""
    hints, default = get_type_hints(cls), cls()
    may_be_none = [f.name for f in fields(cls) if type(None) in get_args(hints[f.name])]
    assert [n for n in may_be_none if getattr(default, n) is not None] == []


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (float("nan"), "scale = nan is no number"),
        (np.float32("nan"), "scale = nan"),
        (np.zeros(2), "numpy.ndarray"),
        (1j, "builtins.complex"),
        (b"x", "builtins.bytes"),
    ],
)
def test_what_is_no_plain_value_is_refused_by_name(value: Any, words: str) -> None:
    for write in (to_toml, as_dict):
        with pytest.raises(ConfigError, match=words) as e:
            write(Everything(scale=value))
        assert "scale" in str(e.value)


def test_half_a_surrogate_pair_and_none_in_a_list_are_refused() -> None:
    with pytest.raises(ConfigError, match="can't be written"):
        to_toml(Everything(text="\ud800"))
    with pytest.raises(ConfigError, match="None"):
        to_toml(Everything(names=(None,)))  # type: ignore[arg-type]


def test_an_infinite_setting_has_a_stage_key() -> None:
    """A key is the hash of JSON, which has no infinity."""
    one, other = (as_dict(Everything(scale=s)) for s in (float("inf"), -float("inf")))
    assert stage_key("s", one) != stage_key("s", other)


def test_the_config_of_a_run_repeats_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read by `--config RUN/config.toml`, every stage gets the settings, and so the key, that it had."""
    from recon import pipeline
    from twin.runs.stages import Run

    class Done(Exception):
        pass

    def run(config: ReconConfig, out: Path) -> dict[str, str]:
        """Keys of the stages, none of which is computed."""
        keys: dict[str, str] = {}

        def stage(self: Run, name: str, version: int, config: Any, upstream: Any, compute: Any) -> Any:
            parts = {"version": version, "config": as_dict(config), "upstream": [u.key for u in upstream]}
            keys[name] = stage_key(name, parts)
            return types.SimpleNamespace(key=keys[name], value=types.SimpleNamespace(static=None))

        def stop(*_: Any) -> None:
            raise Done

        monkeypatch.setattr(Run, "stage", stage)
        monkeypatch.setattr(pipeline, "assemble", stop)
        with pytest.raises(Done):
            pipeline.reconstruct(recording, config, out=out)
        return keys

    recording = open_recording(
        tiny.write_recording(tmp_path / "r", ("door",), frames=40, scale=1, still=True)
    )
    changed = from_dict(
        ReconConfig, {"tracks": {"cell": 10, "max_depth": float("inf")}, "labels": {"every": 3}}
    )
    for config in (ReconConfig(), changed):
        first = run(config, tmp_path / "a")
        again = run(load_config(ReconConfig, tmp_path / "a" / "config.toml"), tmp_path / "b")
        assert len(first) >= 9
        assert first == again
        assert (tmp_path / "a" / "config.toml").read_bytes() == (tmp_path / "b" / "config.toml").read_bytes()
