"""How often robots open and close what the twins show, and what it takes: writes benchmarks/replay.md.

usage: python benchmarks/replay.py [RUN ...] [--recordings FOLDER ...] [--seeds 2] [--trials 20] [--robots
franka spot]

Random cabinets of benchmarks/scenes/random_furniture.py, the true geometry of recordings that have truth, and
the twins of RUN folders. Each part is planned and replayed open and shut; the plan for opening is also
replayed on parts whose axis is 5 degrees, pivot 2 cm and contact 1 cm off. Limits are judged by
benchmarks/replay_judge.py. Finished rows are kept in --rows and not measured again.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from replay_cases import Case, cases
from replay_judge import Judge
from replay_page import CONTROLS, page

import robots
from robots.floor import find_floor
from robots.reasons import reason
from robots.scene.world import World, build_world
from robots.simulation.replay import simulate
from robots.simulation.report import measure
from robots.trajectory import RobotTrajectory
from robots.trials.batch import replay_all
from robots.trials.perturbation import Draw, draw, spread_of
from robots.trials.report import LADDER
from twin.errors import FuntwinError
from twin.scene import Revolute, Twin

HERE = Path(__file__).resolve().parent


def main(arguments: Sequence[str]) -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", metavar="RUN", nargs="*", type=Path, help="folders that hold twin/")
    parser.add_argument("--recordings", nargs="*", default=[], type=Path, help="folders that hold truth/")
    parser.add_argument("--seeds", type=int, default=2, help="random cabinets of each kind and handle [2]")
    parser.add_argument("--trials", type=int, default=20, help="replays with errors for each part [20]")
    parser.add_argument("--robots", nargs="+", default=["franka", "spot"])
    parser.add_argument("--only", default="", help="parts whose name holds this")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--rows", type=Path, default=Path("out/replay_rows.jsonl"))
    parser.add_argument("--out", type=Path, default=HERE / "replay.md")
    options = parser.parse_args(arguments)
    wanted = [
        (case, robot)
        for case in cases(options.seeds, options.recordings, options.runs)
        if options.only in case.name
        for robot in options.robots
    ]
    rows = {key(r): r for r in _read(options.rows)}
    todo = [(c, r) for c, r in wanted if (c.origin, c.name, r) not in rows]
    options.rows.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(options.processes) as pool, options.rows.open("a", encoding="utf-8") as file:
        futures = [pool.submit(one, c, r, options.trials) for c, r in todo]
        for future in as_completed(futures):
            try:
                row = future.result()
            except Exception:
                pool.shutdown(cancel_futures=True)
                raise
            rows[key(row)] = row
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(_line(row), flush=True)
    done = [rows[(c.origin, c.name, r)] for c, r in wanted]
    options.out.write_text(page(done, options.trials), encoding="utf-8")
    return 0


def key(row: dict[str, Any]) -> tuple[str, str, str]:
    """What a row is found by."""
    return row["origin"], row["case"], row["robot"]


def _read(path: Path) -> Iterable[dict[str, Any]]:
    if path.is_file():
        yield from (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())


@lru_cache(maxsize=2)
def _twin(case: Case) -> Twin:
    return case.twin()


def one(case: Case, robot: str, trials: int) -> dict[str, Any]:
    """Everything about one part and one robot."""
    twin = _twin(case)
    part = twin.parts[0]
    assert part.contact is not None
    floor = find_floor(twin)
    row: dict[str, Any] = {
        "case": case.name, "origin": case.origin, "robot": robot, "joint": part.joint.kind,
        "height": float(part.contact.point[2] - floor.height), "floor": floor.source,
    }  # fmt: skip
    row["open"], plan = _task(twin, robot, "open")
    row["close"], _ = _task(twin, robot, "close")
    if plan is not None:
        row["errors"] = _errors(uncertain(twin), robot, trials)
    return row


def _task(twin: Twin, robot: str, goal: str) -> tuple[dict[str, Any], RobotTrajectory | None]:
    part, spec = twin.parts[0], robots.resolve(robot)
    started = time.process_time()
    try:
        plan = robots.plan(twin, part.id, robot, goal=goal)
    except FuntwinError as e:
        return {"plan_s": time.process_time() - started, "success": False, "reason": str(e)}, None
    planned = time.process_time() - started
    started = time.process_time()
    world = _world(twin, robot, plan)
    record, _ = simulate(world, plan, robots.ReplayConfig())
    report = measure(record, plan, part, spec, time.process_time() - started, None)
    judge = Judge(world, plan.T_world_base, spec)
    simulate(world, plan, robots.ReplayConfig(), judge)
    return {
        "plan_s": planned,
        "times_real": report.duration / report.wall_seconds,
        "success": report.success_90 and report.at_rest,
        "clean": report.ok,
        "reached": report.reached,
        "peak": report.opening_peak,
        "slip_mm": report.slip_mm,
        "tracking_mm": report.tracking_max_mm,
        "torque": max(report.torque_share),
        "reason": report.reason,
        "unintended": [(*u.bodies, round(u.depth_mm, 2)) for u in report.unintended],
        "grasp": report.grasp,
        "judge": asdict(judge.found),
        "broken": judge.found.broken,
        "impedance": _softly(twin, robot, plan),
    }, plan


def _softly(twin: Twin, robot: str, plan: RobotTrajectory) -> dict[str, Any]:
    """The same plan with the compliant hand."""
    config = robots.ReplayConfig(control="impedance")
    world, spec = _world(twin, robot, plan), robots.resolve(robot)
    started = time.process_time()
    record, _ = simulate(world, plan, config)
    seconds = time.process_time() - started
    report = measure(record, plan, twin.parts[0], spec, seconds, None)
    judge = Judge(world, plan.T_world_base, spec)
    simulate(world, plan, config, judge)
    return {
        "success": report.success_90 and report.at_rest,
        "clean": report.ok,
        "reached": report.reached,
        "times_real": report.duration / seconds,
        "reason": report.reason,
        "broken": judge.found.broken,
    }


def _world(twin: Twin, robot: str, plan: RobotTrajectory) -> World:
    return build_world(twin, robots.resolve(robot), plan.T_world_base, plan.pedestal)


def uncertain(twin: Twin) -> Twin:
    """The twin saying of itself that it is as wrong as the errors are; the plan may know that."""
    part, sizes = twin.parts[0], LADDER[-1]
    turning = isinstance(part.joint, Revolute)
    variance = [sizes.axis**2 / 2] * 2 + ([sizes.pivot**2 / 2] * 2 if turning else [])
    joint = replace(part.joint, covariance=np.diag(variance))
    return replace(twin, parts=(replace(part, joint=joint), *twin.parts[1:]))


def _errors(twin: Twin, robot: str, trials: int) -> dict[str, Any]:
    part = twin.parts[0]
    try:
        plan = robots.plan(twin, part.id, robot)
    except FuntwinError as e:
        none = {"trials": trials, "success": 0, "clean": 0, "opening": 0.0, "reasons": {str(e): trials}}
        return dict.fromkeys(CONTROLS, none)
    world, spread = _world(twin, robot, plan), spread_of(part)
    draws = [draw(part, spread, LADDER[-1], 0, k) for k in range(trials)]
    return {c: _trials(twin, world, plan, draws, c) for c in CONTROLS}


def _trials(
    twin: Twin,
    world: World,
    plan: RobotTrajectory,
    draws: Sequence[Draw],
    control: Literal["position", "impedance"],
) -> dict[str, Any]:
    part = twin.parts[0]
    config = robots.ReplayConfig(control=control)
    reports = replay_all(world, plan, part, draws, config, workers=1)
    good = [r.success_90 and r.at_rest for r in reports]
    why = [
        r.faults[0].kind if r.faults else reason("StillMoving").kind
        for r, ok in zip(reports, good, strict=True)
        if not ok
    ]
    return {
        "trials": len(draws),
        "success": int(sum(good)),
        "clean": int(sum(r.ok for r in reports)),
        "opening": float(np.mean([r.opening_final for r in reports])),
        "reasons": dict(Counter(why)),
    }


def _line(row: dict[str, Any]) -> str:
    said = [f"{row['origin'][:8]:8s} {row['case']:28s} {row['robot']:7s} {row['height']:.2f}"]
    for goal in ("open", "close"):
        r = row[goal]
        if "reached" in r:
            said.append(
                f"{goal} {r['reached']:.2f} {'ok' if r['clean'] else 'NO'} slip {r['slip_mm']:.1f} torque {r['torque']:.2f} "
                f"plan {r['plan_s']:.1f} x{r['times_real']:.0f} {r['reason']} {r['broken'] or ''}"
            )
        else:
            said.append(f"{goal} FAILED {r['reason']} plan {r['plan_s']:.1f}")
    if "errors" in row:
        for control, e in row["errors"].items():
            said.append(f"{control} {e['success']}/{e['trials']} clean {e['clean']} {e['reasons'] or ''}")
    return " | ".join(said)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
