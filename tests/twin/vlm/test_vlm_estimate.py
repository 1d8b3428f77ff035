"""A model's answer: read against its schema, judged against the part, weighed against geometry x table."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("httpx", reason="needs the extra vlm")

from benchmarks.scenes.boards import cabinet_twin
from tests.makers.twin.vlm_server import KEY, Reply, Server, completion, serving
from twin.cli import main as cli
from twin.errors import InputError, SceneError, ServiceError
from twin.physics import with_physics
from twin.physics.edit import given, set_physics
from twin.physics.materials import read_materials
from twin.quantities import Quantity
from twin.report import save_key_frames
from twin.scene import Twin
from twin.storage import load, save
from twin.vlm.answer import read_physical
from twin.vlm.estimate import SIGMA, apply, body_of, combined, judge
from twin.vlm.picture import best_frame, part_picture


def answer(**changes: Any) -> dict[str, Any]:
    """A sound answer about the door of `cabinet_twin`: 0.6 x 0.58 x 0.018 m, 4.4 kg."""
    sound = {
        "object_name": "cabinet door",
        "assumed_geometry": {"shape": "panel", "dimensions_m": {"w": 0.6, "h": 0.58, "t": 0.018}},
        "assumed_material": "MDF",
        "estimated_density_kg_m3": 750,
        "estimated_mass_kg": 5.0,
        "inertia_tensor_kg_m2": {"Ixx": 0.14, "Iyy": 0.29, "Izz": 0.15, "Ixy": 0.0, "Ixz": 0, "Iyz": 0.0},
        "notes": "a plain front",
    }
    return sound | changes


def reply(**changes: Any) -> Reply:
    return Reply(completion(json.dumps(answer(**changes))))


@pytest.fixture(scope="module")
def twin() -> Twin:
    bare = cabinet_twin()
    labels = {}
    for frame, (part, hand) in {10: (200, 0), 20: (900, 800), 30: (800, 10), 40: (3, 0)}.items():
        image = np.ones((48, 64), np.uint8)
        image.ravel()[:part] = 2
        image.ravel()[2000 : 2000 + hand] = 255
        labels[frame] = image
    parts = tuple(replace(p, inertial=None, physics=None) for p in bare.parts)
    return with_physics(replace(bare, parts=parts, labels=labels))


def test_an_answer_may_stand_in_a_fence_or_between_sentences() -> None:
    text = json.dumps(answer())
    for shape in ("{}", "```json\n{}\n```", "Here it is:\n```\n{}\n```\nDone.", "The object: {} as asked."):
        got = read_physical(shape.replace("{}", text, 1))
        assert got.mass == 5.0
        assert got.inertia[1, 1] == 0.29
        assert np.array_equal(got.dimensions, [0.6, 0.58, 0.018])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("I can't tell.", "not JSON"),
        ('{"estimated_mass_kg": 3', "not JSON"),
        ("[1, 2]", "not a JSON object"),
        ("[" * 100_000, "not JSON"),
        (json.dumps(answer()).replace("5.0", "NaN"), "not JSON.*NaN"),
        (json.dumps(answer()).replace("5.0", "1e999"), "estimated_mass_kg must be a finite number"),
        (json.dumps(answer(estimated_mass_kg="5 kg")), "estimated_mass_kg must be a number, is '5 kg'"),
        (json.dumps(answer(estimated_mass_kg=True)), "estimated_mass_kg must be a number"),
        (json.dumps(answer(estimated_mass_kg=0)), "estimated_mass_kg must be positive"),
        (json.dumps(answer(estimated_density_kg_m3=-1)), "estimated_density_kg_m3 must be positive"),
        (json.dumps(answer(assumed_material=None)), "assumed_material must be a text"),
        (json.dumps(answer(assumed_geometry="box")), "assumed_geometry must be an object"),
        (json.dumps(answer(inertia_tensor_kg_m2={"Ixx": 1})), "inertia_tensor_kg_m2.Iyy is missing"),
        (json.dumps(answer(assumed_geometry={"shape": "box", "dimensions_m": {}})), "dimensions_m must hold"),
        (
            json.dumps(answer(assumed_geometry={"shape": "box", "dimensions_m": {"w": "0.6"}})),
            "dimensions_m.w must be a number",
        ),
        (json.dumps({k: v for k, v in answer().items() if k != "estimated_mass_kg"}), "mass_kg is missing"),
    ],
)  # fmt: skip
def test_an_answer_of_the_wrong_form_is_refused_by_field(text: str, message: str) -> None:
    with pytest.raises(ServiceError, match=message):
        read_physical(text)


def test_the_bounds_of_a_part_hold_what_it_can_weigh(twin: Twin) -> None:
    door = twin.part("door")
    body = body_of(door.mesh, read_materials())
    assert body.edges[:2] == pytest.approx((0.6, 0.576), abs=0.01)
    assert body.mass[0] < 0.1
    hull_of_steel = 0.6 * 0.58 * 0.07 * 7900
    assert 4.4 < body.mass[1] <= hull_of_steel
    flat = replace(door.mesh, vertices=np.array(door.mesh.vertices) * [1.0, 1.0, 0.0])
    assert body_of(flat, read_materials()).mass[1] > 1.0, "a flat surface stands for a board"
    with pytest.raises(SceneError, match="no area"):
        body_of(replace(door.mesh, vertices=np.zeros_like(door.mesh.vertices)), read_materials())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"estimated_mass_kg": 5000.0}, "5000 kg is no mass of door"),  # grams
        ({"estimated_mass_kg": 0.01}, "0.01 kg is no mass of door"),
        (
            {"assumed_geometry": {"shape": "panel", "dimensions_m": {"w": 60.0, "h": 58.0, "t": 1.8}}},
            "60 x 58 are not the metres of door, 0.60 x 0.58 m",
        ),
    ],
)
def test_an_answer_that_no_part_can_have_is_refused(
    changes: dict[str, Any], message: str, twin: Twin
) -> None:
    before = twin.part("door")
    with pytest.raises(ServiceError, match=message):
        apply(twin, "door", read_physical(json.dumps(answer(**changes))), "seer-1")
    assert twin.part("door") is before


@pytest.mark.parametrize(
    ("changes", "left_out", "keeps_mass"),
    [
        ({}, [], True),
        (
            {"assumed_geometry": {"shape": "panel", "dimensions_m": {"w": 1.5, "h": 1.4}}},
            ["its size 1.5 x 1.4 m and the mass"],
            False,
        ),
        ({"estimated_density_kg_m3": 0.75}, ["its density 0.75"], True),  # g/cm^3
        ({"estimated_density_kg_m3": 80.0}, ["need more room than door has"], True),
        ({"inertia_tensor_kg_m2": dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0)}, ["positive"], True),
        (
            {"inertia_tensor_kg_m2": {"Ixx": 0.1, "Iyy": 0.1, "Izz": 0.5, "Ixy": 0, "Ixz": 0, "Iyz": 0}},
            ["triangle"],
            True,
        ),
        (
            {"inertia_tensor_kg_m2": {"Ixx": 14, "Iyy": 29, "Izz": 15, "Ixy": 0, "Ixz": 0, "Iyz": 0}},
            ["does not follow from its mass"],
            True,
        ),
    ],
)  # fmt: skip
def test_fields_that_contradict_the_part_are_left_out(
    changes: dict[str, Any], left_out: list[str], keeps_mass: bool, twin: Twin
) -> None:
    door = twin.part("door")
    verdict = judge(read_physical(json.dumps(answer(**changes))), door, body_of(door.mesh, read_materials()))
    assert len(verdict.left_out) == len(left_out)
    for text, part in zip(verdict.left_out, left_out, strict=True):
        assert part in text
    assert (verdict.mass is not None) == keeps_mass


def test_two_opinions_combine_as_log_normals_do() -> None:
    """Against the density product on a grid: mean and spread of ln(mass)."""
    prior = Quantity(4.0, "geometry: test", (4.0 / 1.8, 4.0 * 1.8))
    got = combined(prior, 6.0)
    assert got is not None
    x = np.linspace(-3, 5, 20_001)
    own = np.log(1.8) / 1.96
    weight = np.exp(-0.5 * ((x - np.log(4)) / own) ** 2 - 0.5 * ((x - np.log(6)) / SIGMA) ** 2)
    mean = float((x * weight).sum() / weight.sum())
    sigma = float(np.sqrt(((x - mean) ** 2 * weight).sum() / weight.sum()))
    assert np.log(got.value) == pytest.approx(mean, abs=1e-6)
    assert np.log(got.interval) == pytest.approx([mean - 1.96 * sigma, mean + 1.96 * sigma], abs=1e-4)
    assert 4.0 < got.value < 6.0
    assert got.interval[1] / got.interval[0] < 1.8**2
    assert combined(prior, 4.0).value == pytest.approx(4.0)
    assert combined(prior, 400.0) is None
    assert combined(prior, 0.04) is None


def test_the_interval_of_both_opinions_covers_the_truth() -> None:
    """Truths drawn from geometry x table, models that err as pictures do: 95 % of the intervals hold the
    truth."""
    rng = np.random.default_rng(1)
    own = float(np.log(1.8)) / 1.96
    held = []
    for _ in range(4000):
        truth = 4.0 * float(np.exp(rng.normal(0, own)))
        got = combined(
            Quantity(4.0, "geometry: test", (4.0 / 1.8, 4.0 * 1.8)),
            truth * float(np.exp(rng.normal(0, SIGMA))),
        )
        if got is not None:
            held.append(got.interval[0] <= truth <= got.interval[1])
    assert len(held) > 3600
    assert 0.935 < np.mean(held) < 0.965


def test_the_error_of_a_picture_is_the_state_of_the_art() -> None:
    """Normal errors of ln(mass) with that standard deviation are off by a factor of 2.2 in the mean."""
    rng = np.random.default_rng(0)
    assert np.exp(np.abs(rng.normal(0, SIGMA, 200_000)).mean()) == pytest.approx(2.2, rel=0.03)


def test_an_answer_changes_mass_and_material_and_says_so(twin: Twin) -> None:
    sound = read_physical(json.dumps(answer()))
    edited = apply(twin, "door", sound, "seer-1")
    part = edited.twin.part("door")
    assert part.inertial.mass.origin == "vlm"
    assert "seer-1 says 5 kg" in part.inertial.mass.source
    assert part.inertial.inertia_source.startswith("geometry")
    assert part.physics.density.value == 750.0
    assert "mdf, named by seer-1" in part.physics.density.source
    assert edited.warnings == ()
    heavy = apply(twin, "door", replace(sound, mass=9.0), "seer-1")
    assert heavy.twin.part("door").inertial.mass.value > part.inertial.mass.value
    assert "lie outside of" in heavy.warnings[-1]
    absurd = apply(twin, "door", replace(sound, mass=60.0), "seer-1")
    assert absurd.twin.part("door").inertial.mass.origin == "geometry"
    assert "not used" in absurd.warnings[-1]
    unknown = apply(twin, "door", replace(sound, material="oak burl"), "seer-1")
    assert "'oak burl' is not in the table" in unknown.warnings[0]
    assert unknown.twin.part("door").physics.density.value == 700.0


def test_what_was_weighed_stays(twin: Twin) -> None:
    weighed = set_physics(
        twin, "door", {"mass": given("mass", 3.9, measured=True), "friction": given("friction", 0.2)}
    ).twin
    edited = apply(weighed, "door", read_physical(json.dumps(answer())), "seer-1")
    part = edited.twin.part("door")
    assert part.inertial.mass == weighed.part("door").inertial.mass
    assert part.physics.friction == weighed.part("door").physics.friction
    assert "stays 3.9 kg" in edited.warnings[0]


def test_the_frame_with_most_part_and_least_hand_is_shown(twin: Twin, tmp_path: Path) -> None:
    door = twin.part("door")
    assert best_frame(twin, door, [10, 20, 30, 40]) == 30
    assert best_frame(twin, door, [30, 20, 10]) == 30
    assert best_frame(twin, door, [40]) is None
    picture = part_picture(twin, door, tmp_path, lambda f: np.full((48, 64, 3), f, np.uint8))
    assert "frame 30" in picture.origin
    shown = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (48, 64, 3)
    border = shown[12:14, :40].reshape(-1, 3).astype(int)
    assert (border[:, 0] - border[:, 1]).max() > 80, "the part is outlined"
    big = part_picture(twin, door, tmp_path, lambda _: np.zeros((1440, 1920, 3), np.uint8))
    assert max(cv2.imdecode(np.frombuffer(big.jpeg, np.uint8), cv2.IMREAD_COLOR).shape) == 1024
    with pytest.raises(InputError, match="no labelled frame shows drawer"):
        part_picture(twin, twin.part("drawer"), tmp_path, lambda _: np.zeros((48, 64, 3), np.uint8))
    save_key_frames(tmp_path, {20: np.zeros((48, 64, 3), np.uint8)}, np.eye(3))
    assert "key frame 20" in part_picture(twin, door, tmp_path).origin
    drawn = part_picture(twin, twin.part("drawer"), tmp_path)
    assert "drawing" in drawn.origin
    assert part_picture(twin, twin.part("drawer"), tmp_path).jpeg == drawn.jpeg, "or it is asked twice"


@pytest.fixture
def run(tmp_path: Path, twin: Twin) -> Path:
    save(twin, tmp_path / "run" / "twin")
    save_key_frames(tmp_path / "run", {30: np.zeros((48, 64, 3), np.uint8)}, np.eye(3))
    return tmp_path / "run"


@pytest.fixture
def told_to_ask(monkeypatch: pytest.MonkeyPatch) -> Callable[[Server], None]:
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "FUNTWIN_VLM_URL", "FUNTWIN_VLM_KEY", "FUNTWIN_VLM_MODEL",
                 "http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):  # fmt: skip
        monkeypatch.delenv(name, raising=False)

    def use(server: Server) -> None:
        monkeypatch.setenv("FUNTWIN_VLM_URL", server.url)
        monkeypatch.setenv("FUNTWIN_VLM_KEY", KEY)
        monkeypatch.setenv("FUNTWIN_VLM_MODEL", "seer-1")

    return use


def test_the_verb_asks_once_and_keeps_no_key(
    run: Path, told_to_ask: Callable[[Server], None], capfd: pytest.CaptureFixture[str]
) -> None:
    with serving(reply()) as server:
        told_to_ask(server)
        assert cli.run(["physics", "estimate", str(run), "--part", "door"]) == 0
        out, err = capfd.readouterr()
        assert "key frame 30" in err
        assert server.url in err
        assert "cabinet door, panel of MDF, 5 kg" in out
        assert load(run).part("door").inertial.mass.origin == "vlm"
        first = (run / "twin" / "twin.json").read_bytes()
        assert cli.run(["physics", "estimate", str(run), "--part", "door", "--json"]) == 0
        assert len(server.asked) == 1, "the second answer is the kept one"
        assert (run / "twin" / "twin.json").read_bytes() == first
        sent = server.asked[0].body["messages"][1]["content"][0]["text"]
        assert "0.60 x 0.58" in sent
        assert "hinge" in sent
    told = "".join((out, err, *capfd.readouterr()))
    kept = [p.read_bytes() for p in run.rglob("*") if p.is_file()]
    assert KEY not in told
    assert not any(KEY.encode() in data for data in kept)


def test_nothing_is_sent_unless_asked(
    run: Path, told_to_ask: Callable[[Server], None], capfd: pytest.CaptureFixture[str]
) -> None:
    with serving(reply()) as server:
        told_to_ask(server)
        assert cli.run(["physics", "show", str(run)]) == 0
        assert cli.run(["physics", "set", str(run), "--part", "door", "--damping", "0.2"]) == 0
        assert cli.run(["physics", "estimate", str(run), "--dry-run"]) == 0
        assert "nothing was sent" in capfd.readouterr().out
    assert server.asked == []


@pytest.mark.parametrize(
    ("answered", "message"),
    [
        (reply(estimated_mass_kg=5000.0), "is no mass of door"),
        (reply(estimated_mass_kg="five"), "must be a number"),
        (Reply(completion("```json\n{broken\n```")), "not JSON"),
        (Reply(b"", 401), "refuses the key"),
        (Reply(completion(None, refusal="no")), "refuses to answer"),
    ],
)
def test_an_unusable_answer_is_one_line_and_changes_nothing(
    answered: Reply,
    message: str,
    run: Path,
    told_to_ask: Callable[[Server], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = (run / "twin" / "twin.json").read_bytes()
    with serving(answered) as server:
        told_to_ask(server)
        assert cli.run(["physics", "estimate", str(run), "--part", "door", "--json"]) == 1
    err = capfd.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert KEY not in err
    assert (run / "twin" / "twin.json").read_bytes() == before


def test_without_key_or_with_another_recording_one_line(
    run: Path, told_to_ask: Callable[[Server], None], capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert cli.run(["physics", "estimate", str(run), "--model", "seer-1"]) == 1
    err = capfd.readouterr().err
    assert "no key for a vision-language model is set" in err
    assert err.count("\n") == 1
    with serving(reply()) as server:
        told_to_ask(server)
        for wrong in (tmp_path / "nowhere", Path(__file__).parents[3] / "assets/recordings/cabinet_drawer"):
            assert cli.run(["physics", "estimate", str(run), "--recording", str(wrong)]) == 1
            assert capfd.readouterr().err.count("\n") == 1
    assert server.asked == []
