"""Verdicts: laws of the types, and how a twin keeps them on disk."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.judged import DOUBT, NOTHING, REFUSAL, doubted
from twin import verdict as v
from twin.errors import InputError, SceneError
from twin.scene import Twin
from twin.storage import digest, load, save
from twin.verdict import REASONS, Verdict, of_twin, reason, verdict_document, verdict_from


@pytest.mark.parametrize("name", sorted(REASONS.keys() - {"OfPart"}))
def test_what_helps_is_another_recording_or_one_of_the_users_words(name: str) -> None:
    told = REASONS[name].help
    told = told if isinstance(told, str) else told({"other": "-y"})
    assert any(word in told for word in ("--at X,Y@FRAME", "--interval A:B", "--type hinge|slide", "--up"))


def test_kinds_leave_the_numbers_out() -> None:
    a, b = reason("AxisUnsure", "doubtful", 1.25, 0.5), reason("AxisUnsure", "refused", 30.0, 0.5)
    assert a.kind == b.kind
    assert a.text != b.text
    assert not any(c.isdigit() for c in a.kind)


def test_a_verdict_is_the_worst_of_its_reasons() -> None:
    assert v.worst([]) == "trusted"
    assert [Verdict(r).level for r in ((), (DOUBT,), (DOUBT, REFUSAL), (REFUSAL, DOUBT))] == [
        "trusted", "doubtful", "refused", "refused",
    ]  # fmt: skip
    assert Verdict((DOUBT, REFUSAL)).main is REFUSAL
    assert Verdict((DOUBT, REFUSAL)).text.startswith(
        "refused: 10 % of its surface was seen to move with it (at least 30 %); keep the whole part"
    )
    assert Verdict((DOUBT, REFUSAL)).text.endswith("(and 1 more reason)")
    assert Verdict().text == "trusted"


def test_a_twin_is_no_better_than_its_worst_part_and_its_own_reasons() -> None:
    trusted, doubtful = Verdict(), Verdict((DOUBT,))
    assert of_twin({"a": trusted}).level == "trusted"
    assert of_twin({"a": trusted, "b": doubtful}).level == "doubtful"
    assert of_twin({"a": trusted}, own=(NOTHING,)).level == "refused"
    assert of_twin({"a": doubtful}).text.startswith("doubtful: a: its axis is known to ± 1.25° only")


def test_what_is_left_out_makes_the_rest_doubtful_and_nothing_refused() -> None:
    lost = {"b": Verdict((DOUBT, REFUSAL))}
    beside = of_twin({"a": Verdict()}, lost)
    assert beside.level == "doubtful"
    assert [r.text for r in beside.reasons] == [
        "b, refused and not written: 10 % of its surface was seen to move with it (at least 30 %)"
    ]
    assert of_twin({}, lost).level == "refused"


@pytest.mark.parametrize("level", ["trusted", "fine", None])
def test_a_reason_is_never_one_to_trust(level: Any) -> None:
    with pytest.raises(SceneError, match="doubtful or refused"):
        reason("AxisUnsure", level, 1.0, 0.5)


def test_a_reason_holds_finite_numbers() -> None:
    with pytest.raises(SceneError, match=r"sigma_deg must be finite"):
        reason("AxisUnsure", "refused", float("inf"), 0.5)


def test_a_twin_keeps_its_verdict_on_disk(tmp_path: Path) -> None:
    twin = doubted()
    save(twin, tmp_path / "twin")
    again = load(tmp_path)
    assert again.verdict == twin.verdict
    assert [p.verdict for p in again.parts] == [p.verdict for p in twin.parts]
    assert (again.extra, again.parts[0].extra) == ({}, {})
    save(again, tmp_path / "other")
    assert (tmp_path / "other" / "twin.json").read_bytes() == (tmp_path / "twin" / "twin.json").read_bytes()
    assert "; doubtful>" in repr(again)
    assert "doubtful" in repr(again.part("door"))


def test_without_a_verdict_nothing_is_claimed(tmp_path: Path) -> None:
    """Neither of twins that somebody stated, nor of those of earlier versions, whose files don't have the
    key."""
    save(cabinet_twin(), tmp_path / "twin")
    file = tmp_path / "twin" / "twin.json"
    document = json.loads(file.read_text())
    assert document.pop("verdict") is None
    for part in document["parts"]:
        assert part.pop("verdict") is None
    file.write_text(json.dumps(document))
    early = load(tmp_path)
    assert early.verdict is None
    assert [p.verdict for p in early.parts] == [None, None]
    assert v.verdict_line(early) == "verdict: none, made before verdicts"
    assert v.verdict_line(replace(early, recorded=None)) == "verdict: none, stated, not reconstructed"


def test_the_digest_knows_verdicts_and_that_there_was_none() -> None:
    """A twin of an earlier version is not taken for one that its user changed; another verdict is another
    result."""
    from twin.storage.document import twin_document

    plain = cabinet_twin()
    assert digest(doubted()) != digest(plain)
    assert digest(doubted()) == digest(doubted())
    import twin.storage as storage

    def early(twin: Twin, meshes: dict[str, Any]) -> dict[str, Any]:
        document = twin_document(twin, meshes)
        document.pop("verdict")
        for part in document["parts"]:
            part.pop("verdict")
        return document

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(storage, "twin_document", early)
        before = digest(plain)
    assert digest(plain) == before


@pytest.mark.parametrize(
    "change",
    [
        {"type": "GhostSeen", "values": {"ghosts": 3}},
        {"values": {"sigma_deg": 1.0, "limit_deg": 0.5, "moon": "full"}},
        {"values": {"sigma_deg": "wide", "limit_deg": 0.5}},
        {"values": 7},
    ],
)
def test_a_reason_of_a_later_version_is_kept_as_text(change: dict[str, Any], tmp_path: Path) -> None:
    save(doubted(), tmp_path / "twin")
    file = tmp_path / "twin" / "twin.json"
    document = json.loads(file.read_text())
    row = document["parts"][0]["verdict"]["reasons"][0]
    row |= change
    file.write_text(json.dumps(document))
    again = load(tmp_path)
    verdict = again.part("door").verdict
    assert verdict is not None
    (kept,) = verdict.reasons
    assert (kept.text, kept.kind, kept.help) == (DOUBT.text, DOUBT.kind, DOUBT.help)
    assert verdict.level == "doubtful"
    save(again, tmp_path / "other")
    written = json.loads((tmp_path / "other" / "twin.json").read_text())
    assert written["parts"][0]["verdict"]["reasons"] == [row]


@pytest.mark.parametrize(
    ("verdict", "told"),
    [
        (
            {"level": "trusted", "reasons": [{"type": "?", "level": "refused", "text": "a"}]},
            "make it 'refused'",
        ),
        ({"level": "doubtful", "reasons": []}, "make it 'trusted'"),
        ({"level": "splendid", "reasons": []}, "not 'splendid'"),
        ({"level": "doubtful", "reasons": "many"}, "list of reasons"),
        ({"level": "doubtful", "reasons": [{"level": "doubtful"}]}, "needs a text"),
        ({"level": "doubtful", "reasons": [{"level": "odd", "text": "a"}]}, "doubtful or refused"),
        ([], "must be an object"),
    ],
)
def test_a_verdict_that_contradicts_itself_is_named(verdict: Any, told: str, tmp_path: Path) -> None:
    save(cabinet_twin(), tmp_path / "twin")
    file = tmp_path / "twin" / "twin.json"
    document = json.loads(file.read_text())
    document["parts"][1]["verdict"] = verdict
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"twin\.json: parts\[1\]\.verdict") as caught:
        load(tmp_path)
    assert told in str(caught.value)


def test_numbers_of_a_reason_are_plain(tmp_path: Path) -> None:
    """A number of numpy's would be refused by twin.json's writer."""
    verdict = Verdict((reason("AxisUnsure", "doubtful", float(np.float64(1.0)), 0.5),))
    save(replace(cabinet_twin(), verdict=verdict), tmp_path / "twin")
    assert load(tmp_path).verdict == verdict


@pytest.mark.parametrize("probability", [None, 0.0, 0.9731, 1.0])
def test_a_verdict_keeps_its_probability(probability: float | None) -> None:
    verdict = Verdict((reason("AxisUnsure", "doubtful", 1.5, 1.25),), probability)
    document = verdict_document(verdict)
    assert document is not None
    assert ("probability" in document) == (probability is not None)
    assert verdict_from(document) == verdict


@pytest.mark.parametrize("probability", [-0.1, 1.2, "sure"])
def test_what_is_no_probability_is_refused(probability: Any) -> None:
    with pytest.raises(SceneError, match="between 0 and 1"):
        verdict_from({"level": "trusted", "reasons": [], "probability": probability})
