"""Twins written by hand through the command line: no traceback, nothing lost in silence, every refusal one
line that names it."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.makers.twin.hand_made import ILLEGAL, LEGAL, OPEN, Case
from tests.makers.twin.hand_made.drafts import cupboard
from twin.cli import main as cli

_OURS = ("report", "export", "stages")  # folders of RUN that verbs fill
_MAIN = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}


@dataclass(frozen=True)
class Said:
    """What a verb ended with and said."""

    code: int
    out: str
    err: str

    @property
    def text(self) -> str:
        """All of it on one line: tables break theirs."""
        return " ".join(f"{self.out} {self.err}".replace("│", " ").split())

    def refusal(self) -> str:
        """The one line of a refusal."""
        assert self.code == 1, self.text
        lines = [line for line in self.err.splitlines() if line.strip()]
        assert len(lines) == 1, self.err
        assert not self.out.strip()
        assert lines[0].startswith("twin: ")
        assert len(lines[0]) < 700, "a line that nobody reads"
        return lines[0]


class User:
    """Someone with a run folder and a command line."""

    def __init__(self, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.run, self._capsys = run, capsys
        self.before, self.text = files(run), (run / "twin" / "twin.json").read_bytes()

    def does(self, *words: str) -> Said:
        self._capsys.readouterr()
        code = cli.run([w if w != "RUN" else str(self.run) for w in words])
        out, err = self._capsys.readouterr()
        assert "Traceback" not in out + err
        return Said(code, out, err)

    def lost(self) -> list[str]:
        """What of the user's is not as it was: files, links, and what twin.json said."""
        now = files(self.run)
        bytes_lost = [p for p, data in self.before.items() if p != "twin/twin.json" and now.get(p) != data]
        said, says = (
            json.loads(text.decode("utf-8-sig"), object_pairs_hook=Pairs)
            for text in (self.text, now["twin/twin.json"])
        )
        return bytes_lost + unsaid(said, says)


class Pairs(list[tuple[str, Any]]):
    """A JSON object with every key it has, also those it has twice."""


def files(folder: Path) -> dict[str, bytes]:
    """Bytes of every file and target of every link below a folder."""
    return {
        p.relative_to(folder).as_posix(): str(p.readlink()).encode() if p.is_symlink() else p.read_bytes()
        for p in folder.rglob("*")
        if p.is_symlink() or p.is_file()
    }


def unsaid(was: Any, now: Any, at: str = "twin.json") -> list[str]:
    """Where `now` does not say what `was` said; null and empty lists said nothing."""
    if was is None or (was == [] and not isinstance(was, Pairs)):
        return []
    if isinstance(was, Pairs) and isinstance(now, Pairs):
        short = [
            f"{at}.{k}" for k, n in Counter(k for k, _ in was).items() if [x for x, _ in now].count(k) != n
        ]
        there = dict(now)
        return short + [p for k, v in was if k in there for p in unsaid(v, there[k], f"{at}.{k}")]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        return [p for k, (a, b) in enumerate(zip(was, now, strict=True)) for p in unsaid(a, b, f"{at}[{k}]")]
    same = was == now and isinstance(was, bool) == isinstance(now, bool)
    return [] if same else [f"{at}: {was!r:.80} -> {now!r:.80}"]


def misstated(document: dict[str, Any], urdf: Path) -> list[str]:
    """Where an exported URDF does not state what twin.json stated: masses, ranges, and how many collision
    shapes."""
    root = ET.parse(urdf).getroot()  # noqa: S314  (a file that we just wrote)
    wrong = []
    for part in document["parts"]:
        link = root.find(f"link[@name='{part['name']}']")
        joint = next(j for j in root.iter("joint") if j.find("child").get("link") == part["name"])  # type: ignore[union-attr]
        limit = joint.find("limit")
        assert link is not None
        assert limit is not None
        stated = [(float(limit.get(k, "nan")), part["joint"][k]) for k in ("lower", "upper")]
        if part["inertial"]:
            stated.append((float(link.find("inertial/mass").get("value")), part["inertial"]["mass"]))  # type: ignore[union-attr,arg-type]
        if part["collision"]:
            stated.append((len(link.findall("collision")), len(part["collision"])))
        wrong += [f"{part['name']}: {a} for {b}" for a, b in stated if not math.isclose(a, b, rel_tol=1e-9)]
    return wrong


@pytest.fixture
def user(request: pytest.FixtureRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> User:
    """The user of the case that the test is given, or of the cupboard."""
    case = request.node.callspec.params.get("case") if hasattr(request.node, "callspec") else None
    run = tmp_path / "Mein Lauf (1)"
    (case.build() if isinstance(case, Case) else cupboard()).write(run)
    return User(run, capsys)


def exported(user: User, name: str) -> list[str]:
    """Formats without a main file."""
    return [f for f, end in _MAIN.items() if not (user.run / "export" / f / f"{name}{end}").is_file()]


def test_there_are_enough_of_each_kind_and_no_two_of_one_name() -> None:
    names = [case.name for case in (*LEGAL, *ILLEGAL, *OPEN)]
    assert len(set(names)) == len(names) >= 60
    assert min(len(LEGAL), len(ILLEGAL)) >= 30
    assert len(OPEN) >= 5
    assert all(case.refused for case in ILLEGAL)


@pytest.mark.slow
@pytest.mark.parametrize("case", LEGAL, ids=lambda c: c.id)
def test_a_legal_twin_is_exported_and_checked_or_told_the_true_cause(case: Case, user: User) -> None:
    document = json.loads(user.text)
    made = user.does("export", "RUN")
    assert made.code == 0, made.text
    assert not exported(user, document["name"])
    assert not user.lost()
    assert not misstated(document, user.run / "export" / "urdf" / f"{document['name']}.urdf")
    checked = user.does("check", "RUN")
    linted = user.does("lint", "RUN")
    shown = user.does("physics", "show", "RUN", "--json")
    assert checked.code == (2 if case.cause else 0), checked.text
    assert linted.code == (2 if case.faults else 0), linted.text
    assert shown.code == 0
    for words, said in (
        (case.warned, f"{made.text} {checked.text}"), (case.cause, checked.text),
        ((*case.faults, *case.doubted), linted.text),
    ):  # fmt: skip
        assert [w for w in words if w not in said] == [], said
    weighed = {name: part["inertial"]["mass"] for name, part in json.loads(shown.out)["parts"].items()}
    assert list(weighed) == [part["name"] for part in document["parts"]]
    assert all(weighed[p["name"]] == p["inertial"]["mass"] for p in document["parts"] if p["inertial"])
    if (user.run / "twin" / "twin.json").read_bytes() != user.text:  # what was filled in is exported alike
        again = user.does("export", "RUN")
        assert again.code == 0, again.text
        assert not user.lost()


@pytest.mark.parametrize("case", ILLEGAL, ids=lambda c: c.id)
def test_an_illegal_twin_is_refused_in_one_line_and_nothing_is_written(case: Case, user: User) -> None:
    line = user.does("export", "RUN").refusal()
    assert [w for w in case.refused if w not in line] == [], line
    assert files(user.run) == user.before
    user.does("check", "RUN").refusal()
    user.does("lint", "RUN").refusal()
    shown = user.does("physics", "show", "RUN")
    if shown.code:  # what only an export looks at is shown
        shown.refusal()
    assert files(user.run) == user.before


@pytest.mark.slow
@pytest.mark.parametrize("case", OPEN, ids=lambda c: c.id)
def test_an_open_twin_is_refused_or_told_of(case: Case, user: User) -> None:
    made = user.does("export", "RUN")
    if made.code == 1:
        line = made.refusal()
        assert [w for w in case.refused if w not in line] == [], line
        assert files(user.run) == user.before
        return
    assert made.code in (0, 2)  # 2: written, and what is wrong with it is told
    assert not exported(user, json.loads(user.text)["name"])
    assert not user.lost()
    told = made.text
    for words in (("check", "RUN"), ("lint", "RUN"), ("physics", "show", "RUN")):
        said = user.does(*words)
        assert said.code in (0, 1, 2)
        if said.code == 1:
            said.refusal()
        told += f" {said.text}"
    assert case.warned, "nothing may be accepted in silence"
    assert [w for w in case.warned if w not in told] == [], told
    assert not user.lost()


WRONG_OPTIONS = [
    ("physics set RUN --mass -1", "mass must be positive", "-1"),
    ("physics set RUN --mass nan", "mass must be positive", "nan"),
    ("physics set RUN --mass heavy", "--mass", "'heavy'"),
    ("physics set RUN --mass 1e300", "1e+300"),
    ("physics set RUN --mass 2 --mass-interval 3 1", "interval of mass", "3 to 1"),
    ("physics set RUN --mass 2 --mass-interval 3 4", "2", "3 to 4"),
    ("physics set RUN --mass 2 --mass-interval 1", "--mass-interval", "2 arguments"),
    ("physics set RUN --mass-interval 1 2", "--mass-interval", "without --mass"),
    ("physics set RUN --friction -0.1", "friction must be zero or more", "-0.1"),
    ("physics set RUN --damping inf", "damping must be zero or more", "inf"),
    ("physics set RUN --material woood", "'woood'", "wood"),
    ("physics set RUN --part dor --mass 2", "'dor'", "did you mean 'door'"),
    ("physics set RUN --part 7 --mass 2", "no part '7'", "door (id 2)"),
    ("physics set RUN", "nothing to set", "--mass"),
    ("physics sett RUN", "'sett'", "set"),
    ("physics show RUN/nowhere", "nowhere", "twin.json"),
    ("export RUN --format stl", "'stl'", "urdf"),
    ("export RUN --package Küche", "'Küche'"),
    ("export RUN --asset autor=Me", "did you mean 'author'"),
    ("export RUN --asset author", "KEY=VALUE"),
    ("export RUN/twin/meshes", "meshes", "twin.json"),
    ("export RUN --force", "--force"),
    ("export", "RUN"),
    ("check RUN", "cupboard.urdf does not exist", "twin export"),
    ("check RUN --engines", "--engines", "at least one"),
    ("check RUN --format usdz", "'usdz'"),
    ("lint RUN", "holds no exported files", "twin export"),
    ("lint RUN/twin/twin.json", "twin.json"),
    ("lint RUN/x.urdf", "x.urdf"),
    ("lint", "no file is named", "--rules"),
    ("lint RUN --ignore everything", "'everything'"),
    ("replay RUN --robot frank", "'frank'", "franka"),
    ("replay RUN --part lid", "'lid'", "door (id 2)"),
    ("replay RUN --goal 1.5", "1.5"),
    ("replay RUN --goal ajar", "'ajar'"),
    ("replay RUN --contact 1,2", "'1,2'", "three numbers"),
    ("replay RUN --control magic", "'magic'"),
    ("replay RUN --stiffness -1", "-1"),
    ("replay RUN --stiffness nan", "nan"),
    ("replay RUN --trials 0", "0"),
    ("replay RUN --trials many", "'many'"),
    ("replay RUN --grid", "--trials"),
    ("replay RUN --recording RUN/nowhere", "nowhere"),
    ("replay RUN --floor high", "'high'"),
    ("replay RUN --floor nan", "nan"),
    ("exprot RUN", "did you mean 'export'"),
]


@pytest.mark.parametrize("line", WRONG_OPTIONS, ids=lambda line: line[0].replace(" ", "_").replace("/", "."))
def test_wrong_options_are_told_in_one_line_and_nothing_changes(line: tuple[str, ...], user: User) -> None:
    command, *words = line
    said = user.does(*(w.replace("RUN", str(user.run)) for w in command.split())).refusal()
    assert [w for w in words if w not in said] == [], said
    assert files(user.run) == user.before
