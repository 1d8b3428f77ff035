"""The tool that plants faults: what it draws, what it plants, and that it tells what tests notice from what
they don't."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.mutants.copies import Copy
from benchmarks.mutants.draw import FEWEST, draw, missing, modules, rooms_of, sample, wanted
from benchmarks.mutants.faults import ROOT, Fault, Gone, read_faults, write_faults
from benchmarks.mutants.page import page
from benchmarks.mutants.rules import CONDITION, CONSTANT, SIGN, TERM, candidates
from benchmarks.mutants.run import NOT_RUN, NOTICED, SURVIVED, Runner, read_results
from benchmarks.mutants.spots import Sources

MODULE = '''"""Doors: -1 is closed."""
import numba

LIMIT = 2.0
FAR = 8.0


def beyond(x, least=0.0):
    if x > LIMIT:
        return x - LIMIT
    return least * x


def never(x):
    return x + 3.0 * x


@numba.njit(cache=True)
def double(x):
    return x * FAR


def doubled(x):
    return double(x + 0.0)
'''
INTERPRETED = MODULE.replace("import numba", "").replace("@numba.njit(cache=True)", "")
TESTS = """import pytest
from recon.room.mod import beyond, doubled


@pytest.fixture(scope="module")
def far():
    return beyond(5.0)


def test_it_runs():
    assert beyond(1.0) == 0.0


def test_something_else(far):
    assert far > 0.0


def test_far(far):
    assert far == 3.0


def test_compiled():
    assert doubled(3.0) == 24.0
"""


def planted(line: str, rule: str) -> set[str]:
    return {c.planted for c in candidates(line) if c.rule == rule}


@pytest.mark.parametrize(
    ("rule", "line", "expected"),
    [
        (SIGN, "y = (a + b) * c", {"y = (a - b) * c"}),
        (SIGN, "y = -(a * χ)", {"y = (a * χ)"}),
        (SIGN, "y -= a", {"y += a"}),
        (CONSTANT, "y = f(a, 0.5)", {"y = f(a, 0.15)"}),
        (CONDITION, "y = a > 1 and b", {"y = True and b", "y = a > 1 and True"}),
        (CONDITION, "y = a < 1 or b < 1", {"y = False or b < 1", "y = a < 1 or False"}),
        (CONDITION, "y = (a > 1) & b", {"y = (a > 1)", "y = b"}),
        (CONDITION, "y = [k for k in a if k > 2]", {"y = [k for k in a if True]"}),
        (CONDITION, "y = a if b > c else d", {"y = a if not (b > c) else d"}),
        (CONDITION, "if not a:\n    pass", {"if  a:"}),
        (TERM, "y = (a - b) * c", {"y = (a) * c", "y = (a - b)", "y = c"}),
        (TERM, "y = a / 'é'", set()),
    ],
)
def test_a_rule_changes_what_it_says(rule: str, line: str, expected: set[str]) -> None:
    assert planted(line, rule) == expected


@pytest.mark.parametrize(
    "line",
    [
        '"""Text - with 0.5 signs."""', 'raise ValueError(f"{a - b} is not 0.5")', "assert a - b == 0.5", 'tell(0.5 * done)',
        "def f(a: int | None) -> list[int | str]: pass", "class C:\n    near: float = 0.5", "x = f(a, atol=1.5)", "y = a[-1]",
        "x = max(a, 1e-12)", "if a is None:\n    pass", "if isinstance(a, B):\n    pass", "x = 0.0", "y = a or B()", "out = [a] + b",
        'x = folder / "name"', "def f() -> str:\n    return g(a - b)", "import a\nfrom b import c", "x = [s for f in a if (s := g(f))]",
    ],
)  # fmt: skip
def test_what_no_test_of_behaviour_is_for_is_left_alone(line: str) -> None:
    assert candidates(line) == []


def blocks(source: str) -> Iterator[range]:
    """Line numbers of each statement of a module; of a class, those of each statement in it."""
    for node in ast.parse(source).body:
        for n in node.body if isinstance(node, ast.ClassDef) else [node]:
            yield range(n.lineno, (n.end_lineno or 0) + 1)


def program(lines: Sequence[str]) -> str:
    """What lines of a statement say, its indent aside."""
    text = "".join(lines)
    return ast.dump(ast.parse(f"if True:\n{text}" if text.startswith(" ") else text))


@pytest.mark.parametrize(
    "room",
    ["recon/interaction/motion", "recon/interaction/parts", "recon/interaction/joints", "recon/interaction/refine", "recon/interaction/labels", "recon/contact", "robots/planning"],
)  # fmt: skip
def test_every_candidate_of_the_sources_is_another_valid_program(room: str) -> None:
    for path in modules(ROOT, room):
        source = path.read_text(encoding="utf-8")
        lines = source.splitlines(keepends=True)
        found, judged = candidates(source), []
        for block in blocks(source):
            own = [lines[k - 1] for k in block]
            before = program(own)
            for c in (c for c in found if c.number in block):
                judged.append(c)
                k = c.number - block.start
                assert own[k].strip() == c.line
                assert program([*own[:k], own[k].replace(c.line, c.planted, 1), *own[k + 1 :]]) != before, c
        assert judged == found


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    """A package of one module and its tests."""
    root = tmp_path / "tiny"
    for name, text in (("recon/room/mod.py", MODULE), ("tests/test_mod.py", TESTS)):
        (root / name).parent.mkdir(parents=True)
        (root / name).write_text(text)
    (root / "pyproject.toml").write_text('[tool.pytest.ini_options]\naddopts = "-p no:dash"\n')
    for folder in ("recon", "recon/room"):
        (root / folder / "__init__.py").write_text("")
    return root


def test_equal_sources_give_an_equal_list_and_moved_lines_keep_their_faults(
    tiny: Path, tmp_path: Path
) -> None:
    first, gone = draw([], tiny, rooms=("recon/room",))
    assert len(first) == wanted([MODULE]) == FEWEST == 3
    assert len({f.rule for f in first}) == 3
    assert gone == []
    assert draw([], tiny, rooms=("recon/room",))[0] == first
    write_faults(first, tmp_path / "list.toml")
    assert read_faults(tmp_path / "list.toml") == first
    path = tiny / "recon/room/mod.py"
    path.write_text(MODULE.replace("import numba", "import math\nimport numba\n\nMORE = [math.pi]"))
    assert draw(first, tiny, rooms=("recon/room",)) == (first, [])
    (tiny / "recon/hall").mkdir()
    path.rename(tiny / "recon/hall/mod.py")
    moved, gone = draw(first, tiny, rooms=("recon/hall",))
    assert moved == [replace(f, file="recon/hall/mod.py") for f in first]
    assert gone == []
    with pytest.raises(FileNotFoundError, match="rooms_of"):
        draw([], tiny, rooms=("recon/attic",))
    (tiny / "recon/hall/mod.py").unlink()
    path.write_text(MODULE.replace(first[0].line, "pass"))
    again, gone = draw(first, tiny, rooms=("recon/room",))
    assert gone == [first[0]]
    assert len(again) == 3
    assert first[1] in again
    with pytest.raises(Gone, match="draw again"):
        first[0].plant(path.read_text())


def test_a_rate_rests_on_faults_beside_the_list(tiny: Path) -> None:
    rooms = ("recon/room",)
    known, _ = draw([], tiny, rooms=rooms)
    every = [sample(known, 9, seed, tiny, rooms) for seed in range(8)]
    assert every == [sample(known, 9, seed, tiny, rooms) for seed in range(8)]
    assert not any(f in known for faults in every for f in faults)
    assert len({f.key for faults in every for f in faults}) > 2
    assert max(len(faults) for faults in every) == 3, "a room has as many as on the list"
    assert [len(sample(known, 1, seed, tiny, rooms)) for seed in range(8)] == [min(1, len(f)) for f in every]


def test_a_named_fault_is_never_thrown_away(tiny: Path) -> None:
    named = Fault("recon/room/mod.py", "by hand", "return x - LIMITS", "return x", name="limit forgotten")
    stand, gone = draw([named], tiny, rooms=("recon/room",))
    assert stand[0] == named
    assert gone == missing([named], tiny) == [named]


def test_the_same_line_twice_is_told_apart() -> None:
    fault = Fault("f.py", SIGN, "x = a - b", "x = a + b", occurrence=2)
    assert (
        fault.plant("if c:\n    x = a - b\nelse:\n    x = a - b\n")
        == "if c:\n    x = a - b\nelse:\n    x = a + b\n"
    )


def test_who_reads_a_constant_or_compiled_code_can_notice_its_fault(tiny: Path) -> None:
    sources = Sources(tiny, ("recon",))

    def lines(line: str) -> set[str]:
        spots = sources.spots(Fault("recon/room/mod.py", "", line, ""), MODULE)
        return {MODULE.splitlines()[k - 1].strip() for _, k in spots}

    assert lines("return x - LIMIT") == {"return x - LIMIT"}
    assert lines("LIMIT = 2.0") == {"if x > LIMIT:", "return x - LIMIT"}
    assert lines("return x * FAR") == lines("FAR = 8.0") == {"return double(x + 0.0)"}


FAULTS = {
    "sign": Fault("recon/room/mod.py", SIGN, "return x - LIMIT", "return x + LIMIT"),
    "default": Fault("recon/room/mod.py", TERM, "return least * x", "return least"),
    "never": Fault("recon/room/mod.py", SIGN, "return x + 3.0 * x", "return x - 3.0 * x"),
    "crash": Fault("recon/room/mod.py", "by hand", "LIMIT = 2.0", "LIMIT = no_such_name"),
}
COMPILED = Fault("recon/room/mod.py", CONSTANT, "FAR = 8.0", "FAR = 2.4")


def test_the_runner_tells_noticed_from_surviving_and_goes_on_where_it_was(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("coverage")
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # the tiny tests need no plugin
    (tiny / "recon/room/mod.py").write_text(INTERPRETED)
    (tiny / "tests/test_mod.py").write_text(TESTS.split("def test_compiled")[0].replace(", doubled", ""))
    told: list[str] = []
    faults = list(FAULTS.values())
    runner = Runner(tiny, tmp_path / "out", 1, told.append)
    before = {p: p.read_bytes() for p in tiny.rglob("*") if p.is_file()}
    runner.run(faults)
    assert {p: p.read_bytes() for p in tiny.rglob("*") if p.is_file()} == before, (
        "the user's tree is untouched"
    )
    results = read_results(runner.results)
    outcome = {name: results[f.key].outcome for name, f in FAULTS.items()}
    assert outcome == {"sign": NOTICED, "default": SURVIVED, "never": NOT_RUN, "crash": NOTICED}
    by = results[FAULTS["sign"].key].by
    assert by == "tests/test_mod.py::test_far", "what a shared fixture made is another test's to judge"
    written = page(faults, results, tiny)
    assert "| `recon/room` | 4 | 2 | 2 | 0 |" in written
    assert "**2 of 4 planted faults are noticed (50 %).**" in written

    told.clear()
    runner.run(faults)
    assert told == ["4 of 4 faults have a result that still holds"]
    with runner.results.open("a") as f:
        f.write('{"key": "cut sho')
    more = (
        "from recon.room.mod import beyond\n\n\ndef test_least():\n    assert beyond(0.5, least=2.0) == 1.0\n"
    )
    (tiny / "tests/test_more.py").write_text(more)
    told.clear()
    runner.run(faults, ["tests/test_mod.py"])
    assert told == ["4 of 4 faults have a result that still holds"], "the new test was not asked"
    told.clear()
    runner.run(faults)
    assert told[0] == "2 of 4 faults have a result that still holds", "a new test may notice what survived"
    results = read_results(runner.results)
    assert results[FAULTS["default"].key].by == "tests/test_more.py::test_least"
    assert results[FAULTS["never"].key].outcome == NOT_RUN


@pytest.mark.slow
def test_a_fault_in_compiled_code_is_compiled(tiny: Path, tmp_path: Path) -> None:
    pytest.importorskip("coverage")
    runner = Runner(tiny, tmp_path / "out", 1, lambda _: None)
    runner.run([COMPILED])
    assert read_results(runner.results)[COMPILED.key].by == "tests/test_mod.py::test_compiled"


def test_a_copy_is_as_it_was_after_a_fault(tiny: Path, tmp_path: Path) -> None:
    """Bytes and time stamp, so that Python and numba take their compiled code again; while planted, neither
    may."""
    (tiny / "recon/hall").mkdir()
    (tiny / "recon/hall/user.py").write_text("import numba\nfrom recon.room.mod import double\n")
    (tiny / "recon/hall/other.py").write_text("import numba\n")
    copy = Copy.of(tiny, tmp_path / "copy")
    path = copy.tree / "recon/room/mod.py"
    cache = path.parent / "__pycache__" / "mod.double-18.py311.nbi"
    of_user, of_other = (copy.tree / f"recon/hall/__pycache__/{n}.f-3.py311.1.nbc" for n in ("user", "other"))
    for file in (cache, of_user, of_other):
        file.parent.mkdir(exist_ok=True)
        file.write_text("of the sound source")
    before = path.stat().st_mtime_ns
    with copy.planted(COMPILED):
        assert "FAR = 2.4" in path.read_text()
        assert path.stat().st_mtime_ns != before
        assert not cache.exists()
        assert not of_user.exists(), "it holds what it compiled of the module"
        assert of_other.exists()
        cache.write_text("of the planted source")
    assert path.read_text() == MODULE
    assert path.stat().st_mtime_ns == before
    assert [f.read_text() for f in (cache, of_user, of_other)] == ["of the sound source"] * 3
    shutil.rmtree(copy.folder)


def test_the_list_holds_the_named_faults_and_every_room() -> None:
    faults = read_faults()
    assert missing([f for f in faults if f.name], ROOT) == []
    assert len(faults) <= 300
    for room in rooms_of(ROOT):
        have = sum(f.room == room for f in faults)
        possible = (
            sum(len(candidates(p.read_text("utf-8"))) for p in modules(ROOT, room)) if have < FEWEST else 3
        )
        assert have >= min(FEWEST, possible), f"{room}: python -m benchmarks.mutants draw"


def test_a_room_has_as_many_faults_as_its_lines_ask_for() -> None:
    assert [wanted(["\n" * n]) for n in (0, 1080, 1296, 3600)] == [3, 3, 4, 10]
    assert wanted(["\n" * 1800] * 2) == 10
