"""A random recording: furniture, what is done with it, room, person, camera and faults, all from one seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from recon.simulate.config import Staging
from recon.simulate.random.fronts import HANDLES
from recon.simulate.random.furniture import KINDS, Furniture
from recon.simulate.random.happenings import Carried, Curtain, Gestures, Screen, SecondPerson
from recon.simulate.random.looks import camera_settings, hand_settings, picture_settings
from recon.simulate.random.model import Placed, furniture_model
from recon.simulate.random.strata import Stratum
from recon.simulate.random.witness import unfit
from recon.simulate.record import require_new
from recon.simulate.script import NOTHING_ELSE, Happening, Script
from recon.simulate.simulator import DepthLag, record
from recon.simulate.stage import Stage
from recon.simulate.timeline import Episode, Leg
from twin.errors import InputError
from twin.files.text import write_json
from twin.runs.settings import as_dict, from_dict
from twin.scene import Prismatic

MOST_DRAWS = 12  # of one seed; more than a few mean that the stratum can't be met
NEAR_FRONT = 0.28  # m^2; smaller fronts would have to be nearer than an arm bends to cover half of a picture
Rng = np.random.Generator

# mean of a move, m/s or rad/s
_SPEED = {"prismatic": (0.08, 0.45), "revolute": (np.deg2rad(15.0), np.deg2rad(75.0))}
_SHORT = {"prismatic": (0.06, 0.10), "revolute": (np.deg2rad(12.0), np.deg2rad(20.0))}
_RATTLE = {"prismatic": (0.001, 0.003), "revolute": (0.003, 0.008)}
_LOW, _HIGH = ("drawer_low", "flap_down", "lid"), ("flap_up", "door_left", "door_right", "drawer_high")


@dataclass(frozen=True)
class Drawn:
    """A recording to be rendered, its stratum, and why earlier draws of the seed were repeated."""

    stage: Stage
    stratum: Stratum
    repeated: tuple[str, ...]

    def to_json(self, seed: int) -> dict[str, Any]:
        """What was drawn, JSON types."""
        return {
            "seed": seed,
            "stratum": as_dict(self.stratum),
            "repeated": list(self.repeated),
            "episodes": as_dict(self.stage.script.episodes),
            "cut_s": list(self.stage.script.cut_s),
            "settings": as_dict(self.stage.config),
        }


def simulate_random(
    seed: int,
    out: Path | str,
    stratum: Stratum | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    depth_lag: DepthLag = 0,
) -> Path:
    """Render a random recording with its truth; truth/random.json tells what was drawn.

    Args:
        seed: at least 0; equal seeds give equal recordings.
        out: folder of the recording; it must be new or empty.
        stratum: what is wanted on purpose, None: drawn as well.
        settings: fields of `Staging` that replace what was drawn, as plain data.
        progress: called with (frames done, frames) after each frame.
        depth_lag: see `simulate`.

    Returns `out`, as `simulate`. Raises InputError, ConfigError.
    """
    folder = Path(out)
    require_new(folder)
    drawn = random_recording(seed, stratum, settings)
    record(drawn.stage, folder, progress, depth_lag)
    write_json(folder / "truth" / "random.json", drawn.to_json(seed))
    return folder


def random_recording(
    seed: int, stratum: Stratum | None = None, settings: Mapping[str, Any] | None = None
) -> Drawn:
    """All is drawn from the seed; stratum: wanted, None: drawn as well. settings: as `simulate_random`.

    A draw is repeated only if no camera or arm could follow. Raises InputError after MOST_DRAWS draws.
    """
    wanted = stratum or Stratum.drawn(np.random.default_rng([seed, 1]))
    repeated: list[str] = []
    for attempt in range(MOST_DRAWS):
        rng = np.random.default_rng([seed, 2, attempt])
        stage = _draw(rng, wanted, seed, settings or {})
        fault = unfit(stage)
        if fault is None:
            return Drawn(stage, wanted, tuple(repeated))
        repeated.append(fault)
    raise InputError(
        f"seed {seed}: none of {MOST_DRAWS} draws can be recorded ({repeated[-1]})", "take another seed"
    )


def _draw(rng: Rng, wanted: Stratum, seed: int, settings: Mapping[str, Any]) -> Stage:
    pieces = _pieces(rng, wanted)
    model = furniture_model(pieces, rng, bool(rng.random() < 0.25))
    episodes = _episodes(rng, wanted, pieces)
    config = Staging(
        seed=int(rng.integers(2**31)),
        width=wanted.size[0],
        height=wanted.size[1],
        fps=wanted.fps,
        sensor=wanted.sensor,
        clutter=int(rng.integers(2, 15)),
        textures=float(rng.choice([1.0, rng.uniform(0.35, 0.9)])),
        samples=2,
        **hand_settings(rng),
        **camera_settings(rng, wanted, pieces),
    )
    config = picture_settings(rng, wanted, config)
    config = from_dict(Staging, merged(as_dict(config), settings), "settings")
    rest_after = float(rng.uniform(0.7, 1.3))
    script = Script(
        model, f"random furniture {seed}", episodes, rest_after, moves_parts=wanted.negative is None
    )
    script = replace(script, happening=_happening(rng, wanted), cut_s=_cut(rng, wanted, script))
    return Stage(script, config)


def merged(drawn: Mapping[str, Any], wished: Mapping[str, Any]) -> dict[str, Any]:
    """What was drawn, with what is wished in its place."""
    out = dict(drawn)
    for key, value in wished.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        out[key] = merged(out[key], value) if both else value
    return out


def _pieces(rng: Rng, wanted: Stratum) -> list[Placed]:
    """One piece of furniture; now and then a second one beside it, whose part is moved as well."""
    kinds = list(KINDS)
    if wanted.view == "steep":
        kinds = [*_LOW] if rng.random() < 0.7 else [*_HIGH]
    made = _furniture(rng, kinds)
    while wanted.view == "near" and _front(made) < NEAR_FRONT:
        made = _furniture(rng, kinds)
    first = Placed("first", made, np.zeros(3))
    if wanted.negative is not None or wanted.view in ("near", "steep") or rng.random() > 0.14:
        return [first]
    second = _furniture(rng, list(KINDS))
    ends = [np.concatenate([b.corners for b in (*m.static, *m.part)]) for m in (first.made, second)]
    side = float(rng.choice([-1.0, 1.0]))
    reach = (
        ends[0][:, 0].max() - ends[1][:, 0].min() if side > 0 else ends[0][:, 0].min() - ends[1][:, 0].max()
    )
    return [first, Placed("second", second, np.array([reach + side * rng.uniform(0.01, 0.1), 0.0, 0.0]))]


def _front(made: Furniture) -> float:
    """Area of the part's largest side, m^2."""
    size = np.sort(np.ptp(np.concatenate([b.corners for b in made.panels]), axis=0))
    return float(size[1] * size[2])


def _furniture(rng: Rng, kinds: list[str]) -> Furniture:
    return KINDS[str(rng.choice(kinds))](rng, str(rng.choice(HANDLES, p=[0.5, 0.25, 0.25])))


def _episodes(rng: Rng, wanted: Stratum, pieces: list[Placed]) -> tuple[Episode, ...]:
    """What the person does: each piece's part in turn."""
    out = []
    for k, piece in enumerate(pieces):
        joint = piece.made.joint
        kind = "prismatic" if isinstance(joint, Prismatic) else "revolute"
        reaches = wanted.negative in (None, "carried", "gestures", "rattle")
        if wanted.negative == "rattle":
            start, legs = 0.0, _rattle(rng, kind)
        elif wanted.negative is not None:
            start, legs = 0.0, (Leg(0.0, float(rng.uniform(1.5, 3.0))),)
        else:
            start, legs = _legs(rng, kind, float(joint.upper), wanted.short)
        wait = rng.uniform(0.7, 1.5) if k == 0 else rng.uniform(0.3, 1.0)
        reach, hold, leave = rng.uniform(0.6, 1.1), rng.uniform(0.15, 0.4), rng.uniform(0.5, 0.9)
        times = (float(wait), float(reach), float(hold), float(leave))
        out.append(Episode(piece.joint, start, legs, *times, reaches=reaches))
    return tuple(out)


def _legs(rng: Rng, kind: str, upper: float, short: bool) -> tuple[float, tuple[Leg, ...]]:
    """Where the part stands and goes: from shut or half open, all or part of the way, paused, or back."""
    way = float(rng.uniform(*_SHORT[kind])) if short else float(rng.uniform(0.45, 1.0)) * upper
    start = 0.0
    if rng.random() < 0.15:  # stands half open first
        start = float(rng.uniform(0.2, 0.6)) * (upper - way)
        if rng.random() < 0.4:  # and is shut
            start = way if short else float(rng.uniform(0.4, 1.0)) * upper
            way = -start
    end = float(np.clip(start + way, 0.0, upper))
    speed = float(np.exp(rng.uniform(*np.log(_SPEED[kind]))))
    legs = [Leg(end, _seconds(end - start, speed))]
    if rng.random() < 0.15:  # a pause on the way
        middle = start + float(rng.uniform(0.3, 0.7)) * (end - start)
        pause = Leg(middle, float(rng.uniform(0.3, 0.9)))
        legs = [Leg(middle, _seconds(middle - start, speed)), pause, Leg(end, _seconds(end - middle, speed))]
    if start == 0.0 and rng.random() < 0.12:  # and shut again
        legs += [Leg(end, float(rng.uniform(0.2, 0.7))), Leg(0.0, _seconds(end, speed))]
    return start, tuple(legs)


def _seconds(way: float, speed: float) -> float:
    return float(np.clip(abs(way) / speed, 0.6, 4.0))


def _rattle(rng: Rng, kind: str) -> tuple[Leg, ...]:
    """To and fro within the play of a shut part."""
    levels = [float(rng.uniform(*_RATTLE[kind])) if k % 2 == 0 else 0.0 for k in range(8)]
    return tuple(Leg(level, float(rng.uniform(0.15, 0.3))) for level in levels)


def _happening(rng: Rng, wanted: Stratum) -> Happening:
    seed = int(rng.integers(2**31))
    made = {
        "carried": Carried,
        "curtain": Curtain,
        "person": SecondPerson,
        "screen": Screen,
        "gestures": Gestures,
    }
    return made[wanted.negative](seed) if wanted.negative in made else NOTHING_ELSE


def _cut(rng: Rng, wanted: Stratum, script: Script) -> tuple[float, float]:
    """Now and then the hand is in view from the first frame or to the last."""
    first, last = script.episodes[0], script.episodes[-1]
    before = after = 0.0
    if wanted.negative is None and rng.random() < 0.1:
        before = first.wait_s + float(rng.uniform(0.3, 0.6)) * first.reach_s
    if wanted.negative is None and rng.random() < 0.1:
        after = script.rest_after_s + float(rng.uniform(0.3, 0.6)) * last.leave_s
    return before, after
