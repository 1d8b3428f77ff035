"""Laws of the settings: each says its meaning, unit and range; what lies outside of the range is refused in
one line; every settings object, written as TOML and read back, is equal; docs/settings.md tells them as they
are."""

from __future__ import annotations

import math
import re
import tomllib
import types
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.config import ReconConfig
from recon.interaction.joints.pose_graph.solver import PoseGraphConfig
from recon.readers import open_recording
from recon.windows.windows import Window
from robots.config import PlanConfig
from tests.laws import assert_for_all
from tests.makers.recon import tiny
from twin.cli.table import SETTINGS, named
from twin.errors import ConfigError
from twin.runs.keys import stage_key
from twin.runs.setting import Settings, rule_of, types_of
from twin.runs.settings import as_dict, from_dict, load_config, to_toml
from twin.runs.settings_list import listed

REPOSITORY = Path(__file__).parents[1]
LINE = 160  # characters of a refusal
# those that the command line knows, and those of a function that takes its own
ROOTS = (*map(named, SETTINGS.values()), PoseGraphConfig)
# TOML holds 64-bit integers; every character but halves of surrogate pairs, which are no text
INTEGERS = st.integers(-(2**63), 2**63 - 1) | st.integers(-3, 100)
TEXTS = st.text(st.characters(exclude_categories=["Cs"])) | st.text(
    "\"'\\\x00\x1f\x7f\r\n\t\u0085\u2028é😀=[]#"
)
FLOATS = st.floats(allow_nan=False) | st.floats(0, 1) | st.floats(1, 100)


def reachable(cls: type) -> Iterator[type]:
    """The class and the settings classes that it holds."""
    yield cls
    for hint in types_of(cls).values():
        for inner in (hint, *get_args(hint)):
            if isinstance(inner, type) and is_dataclass(inner):
                yield from reachable(inner)


CLASSES = list(dict.fromkeys(c for root in ROOTS for c in reachable(root)))


FIELDS = [(c, f.name) for c in CLASSES for f in fields(c) if not is_dataclass(types_of(c)[f.name])]


def numeric(hint: Any) -> type | None:
    """int or float where a field holds numbers, alone, in a tuple, or beside None."""
    return next((t for t in (hint, *get_args(hint)) if t in (int, float)), None)


def variants(cls: type, name: str, number: Any) -> Iterator[Any]:
    """The field's value with the number in each of its places."""
    if get_origin(types_of(cls)[name]) is not tuple:
        yield number
    else:
        now = getattr(cls(), name)
        yield from ((*now[:k], number, *now[k + 1 :]) for k in range(len(now)))


def beside(cls: type, name: str) -> Iterator[tuple[Any, bool]]:
    """Numbers at and next to each bound of a field, and whether they are allowed."""
    rule, whole = rule_of(cls.__dataclass_fields__[name]), numeric(types_of(cls)[name]) is int  # type: ignore[attr-defined]
    for bound, inside, excluded in (
        (rule.above, 1, True),
        (rule.at_least, 1, False),
        (rule.below, -1, True),
        (rule.at_most, -1, False),
    ):
        if bound is not None:
            step = (
                (lambda d, b=bound: b + d) if whole else (lambda d, b=bound: math.nextafter(b, d * math.inf))
            )
            yield from ((step(inside), True), (bound, not excluded), (step(-inside), False))


def test_every_setting_says_meaning_unit_and_range() -> None:
    def law(cls: type, name: str) -> None:
        rule = rule_of(cls.__dataclass_fields__[name])  # type: ignore[attr-defined]
        assert len(rule.meaning) > 5
        assert "\n" not in rule.meaning
        if numeric(types_of(cls)[name]):
            assert rule.bounds, "a number needs a range"
            assert rule.above is not None or rule.at_least is not None, "the range needs a lower end"
            assert rule.unit is not None, 'a number needs a unit, "" where it has none'

    assert_for_all(law, FIELDS)


def test_every_class_and_group_says_what_it_is() -> None:
    def law(cls: type) -> None:
        assert issubclass(cls, Settings)
        assert not str(cls.__doc__).startswith((f"{cls.__name__}(", "None")), "one that dataclass made up"
        groups = [f for f in fields(cls) if is_dataclass(types_of(cls)[f.name])]
        assert [f.name for f in groups if not rule_of(f).meaning] == []

    assert_for_all(law, CLASSES)


def test_no_class_of_settings_is_left_out() -> None:
    found = set()
    for package in ("recon", "robots", "twin"):
        for path in (REPOSITORY / package).rglob("*.py"):
            found |= set(
                re.findall(r"^class (\w+)\(Settings\)|^class (\w+Config)\b", path.read_text(), re.MULTILINE)
            )
    assert {a or b for a, b in found} == {c.__name__ for c in CLASSES}


def test_a_number_beside_its_range_is_refused_in_one_line() -> None:
    def law(cls: type, name: str) -> None:
        rule = rule_of(cls.__dataclass_fields__[name])  # type: ignore[attr-defined]
        cases = [*beside(cls, name), (math.nan, False), (True, False), ("1", False)]
        cases += [] if rule.infinite else [(math.inf, False), (-math.inf, False)]
        for number, allowed in cases:
            for value in variants(cls, name, number):
                if allowed:
                    assert getattr(cls(**{name: value}), name) == value
                    continue
                with pytest.raises(ConfigError, match=rf"^{cls.__name__}\.{name}(\[\d\])? = ") as e:
                    cls(**{name: value})
                assert len(str(e.value)) <= LINE
                assert "\n" not in str(e.value)

    assert_for_all(law, [(cls, name) for cls, name in FIELDS if numeric(types_of(cls)[name])])


def test_a_refusal_names_the_setting_as_its_user_does() -> None:
    def law(cls: type, path: str) -> None:
        data: dict[str, Any] = {}
        *tables, name = path.split(".")
        inner = data
        for table in tables:
            inner = inner.setdefault(table, {})
        inner[name] = [{}]  # what no setting takes
        with pytest.raises(ConfigError, match=rf"^--set: {re.escape(path)}(\[0\])?(\b|\s)") as e:
            from_dict(cls, data, "--set")
        assert len(str(e.value)) <= LINE

    assert_for_all(law, [(c, s.path) for c in map(named, SETTINGS.values()) for s in listed(c())])


def script(name: str) -> dict[str, Any]:
    """What a script in .ci defines."""
    made: dict[str, Any] = {"__name__": "script", "__file__": str(REPOSITORY / ".ci" / name)}
    exec((REPOSITORY / ".ci" / name).read_text(), made)  # noqa: S102
    return made


def test_the_page_of_settings_is_up_to_date() -> None:
    page = (REPOSITORY / "docs/settings.md").read_text()
    assert page == script("settings_page.py")["page"](), "run: python .ci/settings_page.py"


def test_a_user_has_at_most_60_settings_to_choose() -> None:
    """What nobody can choose sensibly is a constant with its source; the paper's own ways don't count."""
    counted = script("constants.py")["settings"]()
    assert sum(count for room, count in counted if room != "the paper's ways") <= 60


@cache  # a strategy takes longer to build than to draw from
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
    for name, hint in types_of(cls).items():
        value = draw(values(hint))
        try:
            # In Python's numbers too, as a file holds them: numpy rounds -1e-308 to float32's -0 before it
            # compares.
            changed, changed_in_python = (
                replace(config, **{name: value}),
                replace(in_python, **{name: plain(value)}),
            )
        except (ConfigError, TypeError, ValueError, OverflowError, RuntimeWarning):
            continue  # the class refuses it, or can't compare a huge float with numpy's float32
        config, in_python = changed, changed_in_python
    return config


def test_bounds_are_compared_in_pythons_numbers() -> None:
    """numpy's 0 in 32 bits equals 1e-308, Python's doesn't: else such an object could be made, and its file
    not be read."""
    bounds = (1.1125369292536007e-308, np.float32(0))
    for one in (bounds, plain(bounds)):
        with pytest.raises(ConfigError, match="pedestal"):
            PlanConfig(pedestal=one)  # type: ignore[arg-type]


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


def test_settings_written_as_toml_are_read_back_equal() -> None:
    @settings(max_examples=40, deadline=None)
    @given(data=st.data())
    def law(cls: type, data: st.DataObject) -> None:
        config = data.draw(configs(cls))
        assert read_back(config) == config

    assert_for_all(law, [*CLASSES, Everything])


def test_the_defaults_are_plain_numbers_in_the_file() -> None:
    def law(cls: type) -> None:
        text = to_toml(cls())
        assert "np." not in text
        assert read_back(cls()) == cls()

    assert_for_all(law, CLASSES)


def test_none_is_only_written_where_it_is_the_default() -> None:
    """TOML has no null: a setting that is None is left out, so None must be what it then becomes."""

    def law(cls: type) -> None:
        hints, default = types_of(cls), cls()
        may_be_none = [f.name for f in fields(cls) if type(None) in get_args(hints[f.name])]
        assert [n for n in may_be_none if getattr(default, n) is not None] == []

    assert_for_all(law, CLASSES)


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

        def stage(
            self: Run, name: str, version: int, config: Any, upstream: Any, compute: Any, **_: str
        ) -> Any:
            parts = {"version": version, "config": as_dict(config), "upstream": [u.key for u in upstream]}
            keys[name] = stage_key(name, parts)
            found: Any = types.SimpleNamespace(
                static=None, doubt=None, up=(0.0, 0.0, 1.0), parts=(), shares=()
            )
            value = {"inspect": (), "windows": (Window(0, 39),)}.get(name, found)
            return types.SimpleNamespace(key=keys[name], value=value, warnings=())

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
        ReconConfig, {"tracks": {"max_width": 320, "max_depth": float("inf")}, "labels": {"every": 3}}
    )
    for config in (ReconConfig(), changed):
        first = run(config, tmp_path / "a")
        again = run(load_config(ReconConfig, tmp_path / "a" / "config.toml"), tmp_path / "b")
        assert len(first) >= 9
        assert first == again
        assert (tmp_path / "a" / "config.toml").read_bytes() == (tmp_path / "b" / "config.toml").read_bytes()
