"""What real cabinet doors resist with, from the logs of a robot that opened them ($FUNTWIN_DATA/door_forces).

    python benchmarks/door_forces.py $FUNTWIN_DATA/door_forces [-o benchmarks/door_forces.md]

The robot hooked the handle and pulled by moving an equilibrium point. Each log has the hand's position and
two forces on it: `f` from the arm's joint torques and `f_ati` from a sensor in the wrist. Method:

1. A circle through the hand's path gives hinge and radius, and with them angle and the force along the path
(positive: the
   robot pulls the door open).
2. While the door has not moved (2 mm), both forces show the same pull, so their difference is friction of the
arm's own joints,
   which f holds and f_ati doesn't.
3. Beyond `BEYOND` the catch and a hinge's closing spring have let go. What is left there is friction (the
pull is slow and even, so
   mass counts for nothing, and what damping adds can't be told from friction without times).
4. Its torque: the wrist's reading times the radius is the estimate; the joint torques less the arm's own
friction, at their 95th
   percentile, are the upper end; the lower end is 0 when the wrist's own zero, which no log shows, could
   explain the whole reading.
5. As a share of weight x lever, which assets/materials.toml asks for: nobody weighed the doors, so they are
taken for furniture board
   `BOARD`, `HEIGHT` high and `BESIDE` wider than the handle's radius; the lever is the radius of gyration
   about the hinge.
6. The catch, with the closing spring that can't be told from it, is what `twin physics catch --log` finds:
the peak less the level of the
   wide open half, which friction and a sensor's offset are part of, and where it has fallen halfway
   (twin/physics/force_log.py).
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.physics.force_log import CatchFit, fit_catch

# rad; chosen by us: the wrist's reading falls steeply up to there in both runs of the IKEA door, and is even
# after
BEYOND = 0.7
STILL = 2e-3  # m
BOARD = 12.6  # kg/m^2: 18 mm of furniture board, as in assets/materials.toml
HEIGHT, BESIDE = 0.6, 0.03  # m; chosen by us: a usual cabinet door, its handle that far from the free edge
GRAVITY = 9.81  # m/s^2
BINS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5)
Array = NDArray[np.float64]


@dataclass(frozen=True)
class DoorLog:
    """One opening. angle (n,) rad from the start, joints and wrist (n,) N along the path, step (n,) m per
    sample."""

    name: str
    radius: float
    fit: float
    angle: Array
    joints: Array
    wrist: Array
    step: Array

    @property
    def free(self) -> NDArray[np.bool_]:
        """Samples beyond catch and spring."""
        return self.angle >= BEYOND

    @property
    def arm_friction(self) -> float:
        """N: joint torques less wrist before the door moves, median."""
        still = self.angle * self.radius < STILL
        return float(np.median(self.joints[still] - self.wrist[still]))

    @property
    def peaks(self) -> tuple[float, float]:
        """N: 99th percentiles of joint torques and wrist before `BEYOND`."""
        joints, wrist = (np.percentile(v[~self.free], 99) for v in (self.joints, self.wrist))
        return float(joints), float(wrist)

    @property
    def friction(self) -> tuple[float, float, float]:
        """N m: median of the wrist, and its 5th and 95th percentile."""
        return tuple(self.radius * float(np.percentile(self.wrist[self.free], p)) for p in (50, 5, 95))  # type: ignore[return-value]

    @property
    def ceiling(self) -> float:
        """N m: the 95th percentile of the joint torques less the arm's own friction."""
        return self.radius * max(0.0, float(np.percentile(self.joints[self.free], 95)) - self.arm_friction)

    @property
    def weight_on_lever(self) -> float:
        """N m: what the door is taken to weigh, times its radius of gyration about the hinge."""
        width = self.radius + BESIDE
        return GRAVITY * BOARD * HEIGHT * width * width / float(np.sqrt(3.0))

    @property
    def catches(self) -> tuple[CatchFit, CatchFit]:
        """N m and rad: by joint torques, and by the wrist."""
        joints, wrist = (fit_catch(self.angle, self.radius * v) for v in (self.joints, self.wrist))
        return joints, wrist

    @property
    def speed_slope(self) -> tuple[float, float]:
        """N per mm of path a sample, and its standard error, of the wrist's reading beyond catch and
        spring."""
        x, y = 1e3 * self.step[self.free], self.wrist[self.free]
        design = np.stack([x, np.ones_like(x)], axis=1)
        solution, *_ = np.linalg.lstsq(design, y, rcond=None)
        spread = float(np.var(y - design @ solution)) * np.linalg.inv(design.T @ design)[0, 0]
        return float(solution[0]), float(np.sqrt(spread))


def read(path: Path) -> DoorLog:
    """Read one log and turn its forces along the path."""
    with np.load(path, allow_pickle=False) as data:
        hand, joints, wrist = data["ee"], data["f"], data["f_ati"]
    flat = hand[:, :2]  # the doors hang upright
    design = np.column_stack([2 * flat, np.ones(len(flat))])
    x, y, c = np.linalg.lstsq(design, (flat**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(c + x * x + y * y))
    arm = flat - [x, y]
    turned = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    turn = np.sign(turned[-1] - turned[0])
    out = arm / np.linalg.norm(arm, axis=1)[:, None]
    along = turn * np.stack([-out[:, 1], out[:, 0]], axis=1)
    step = np.gradient(turned) * turn * radius
    return DoorLog(
        name=path.stem,
        radius=radius,
        fit=float(np.std(np.linalg.norm(arm, axis=1))),
        angle=turn * (turned - turned[0]),
        joints=-np.einsum("ni,ni->n", joints[:, :2], along),  # the force on the hand is opposite to its pull
        wrist=-np.einsum("ni,ni->n", wrist[:, :2], along),
        step=step,
    )


def interval(logs: list[DoorLog]) -> tuple[float, float, float]:
    """Friction torque (N m) of a cabinet door: low, value, high. Value: the median over the logs; see the
    module's points."""
    value = float(np.median([max(0.0, log.friction[0]) for log in logs]))
    return 0.0, value, max(log.ceiling for log in logs)


def catch(logs: list[DoorLog]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Force (N m) and width (rad) of a cabinet door's catch: value, low, high. Medians of the wrist; of the
    force from its least to the most that the joint torques tell, which an arm's friction under load is part
    of, of the width all that any log tells."""
    wrist, joints = [log.catches[1] for log in logs], [log.catches[0] for log in logs]
    force = float(np.median([c.force[0] for c in wrist]))
    width = float(np.median([c.width[0] for c in wrist]))
    both = [*wrist, *joints]
    return (
        (force, min(c.force[1] for c in wrist), max(c.force[2] for c in joints)),
        (width, min(c.width[1] for c in both), max(c.width[2] for c in both)),
    )


def share(logs: list[DoorLog]) -> tuple[float, float, float]:
    """The same as a share of weight x lever."""
    value = float(np.median([max(0.0, log.friction[0]) / log.weight_on_lever for log in logs]))
    return 0.0, value, max(log.ceiling / log.weight_on_lever for log in logs)


def table(logs: list[DoorLog]) -> str:
    """The page."""
    low, value, high = interval(logs)
    shares = share(logs)
    lines = [
        "# Forces of real cabinet doors, and the friction of hinges",
        "",
        "`python benchmarks/door_forces.py $FUNTWIN_DATA/door_forces -o benchmarks/door_forces.md` writes this page; its docstring tells the method.",
        "A PR2 robot opened an IKEA cabinet (twice) and one in a lab (gt-ros-pkg/hrl at 04f9ad3829ca, New BSD).",
        "",
        "| log | radius m (fit mm) | range rad | peak N: joints, wrist | arm's own friction N | friction by wrist N m (5–95 %) | ceiling by joints N m | wrist against speed N per mm/sample |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for log in logs:
        mid, least, most = log.friction
        joints, wrist = log.peaks
        slope, error = log.speed_slope
        lines.append(
            f"| {log.name} | {log.radius:.3f} ({1e3 * log.fit:.1f}) | {log.angle.max():.2f} | {joints:.1f}, {wrist:.1f} "
            f"| {log.arm_friction:.1f} | {mid:.2f} ({least:.2f}–{most:.2f}) | {log.ceiling:.2f} | {slope:+.2f} ± {error:.2f} |"
        )
    lines += [
        "",
        (
            f"Friction torque of a cabinet door: **{value:.2f} N m, {low:.0f} to {high:.1f}**; of weight x lever, were they furniture board "
            f"{HEIGHT:g} m high: **{shares[1]:.3f}, {shares[0]:.0f} to {shares[2]:.2f}**. Medians along the path, joint torques / wrist, N:"
        ),
        "",
        "| log | " + " | ".join(f"{a:g}–{b:g} rad" for a, b in itertools.pairwise(BINS)) + " |",
        "|---" * len(BINS) + "|",
    ]
    for log in logs:
        cells = []
        for a, b in itertools.pairwise(BINS):
            there = (log.angle >= a) & (log.angle < b)
            cells.append(f"{np.median(log.joints[there]):.1f} / {np.median(log.wrist[there]):.1f}")
        lines.append(f"| {log.name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, *_catches(logs), *_lessons(logs)])


def _catches(logs: list[DoorLog]) -> list[str]:
    """The table of what holds a closed door."""
    force, width = catch(logs)
    lines = [
        "",
        (
            f"Catch of a cabinet door, with its closing spring: **{force[0]:.1f} N m, {force[1]:.1f} to {force[2]:.1f}**, over "
            f"**{width[0]:.2f} rad, {width[1]:.2f} to {width[2]:.2f}**. Peak less level N m, and where it has fallen halfway, rad:"
        ),
        "",
        "| log | by wrist | over | by joint torques | over |",
        "|---|---|---|---|---|",
    ]
    for log in logs:
        joints, wrist = log.catches
        cells = [f"{v[0]:.2f} ({v[1]:.2f}–{v[2]:.2f})" for c in (wrist, joints) for v in (c.force, c.width)]
        lines.append(f"| {log.name} | {' | '.join(cells)} |")
    return lines


def _lessons(logs: list[DoorLog]) -> list[str]:
    def span(values: list[float]) -> str:
        return f"{min(values):.1f} to {max(values):.1f}"

    arm = span([log.arm_friction for log in logs])
    free = span([float(np.median((log.joints - log.wrist)[log.free])) for log in logs])
    wrist, joints = (span([log.peaks[k] for log in logs]) for k in (1, 0))
    catch = span([log.peaks[1] * log.radius for log in logs])
    start = span([float(np.abs(log.wrist[log.angle * log.radius < STILL]).max()) for log in logs])
    return [
        "",
        "What to take from it:",
        "",
        f"- The joint torques show {arm} N more than the wrist before anything moves and {free} N more while the door turns freely:",
        "  the arm's own friction, not the door's. `ftan` in the logs, 7 to 14 N after the catch, holds it.",
        f"- Up to {BEYOND} rad stand catch and closing spring: at most {wrist} N by the wrist ({catch} N m), {joints} N by the joint torques.",
        "  A twin has a catch only where its user asks for one (`twin physics catch`); with it goes the spring, as one constant force.",
        "- The joint torques tell twice what the wrist tells in both runs of the IKEA door, and less in the lab's: a log's sensor may be wrong by",
        "  a factor, and no fit of that log alone knows.",
        f"- The zero of the wrist sensor is not known; while nothing moves yet it reads up to {start} N. So no friction at all can't be",
        "  excluded, and the joint torques less the arm's friction bound it from above.",
        "- Damping can't be had from these logs: they carry no times, and the slope of the force against the path a sample changes its sign",
        "  from log to log.",
        "- There is no log of a drawer.",
        "",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path)
    args = parser.parse_args()
    page = table([read(p) for p in sorted(args.folder.glob("*.npz"))])
    if args.out:
        args.out.write_text(page, encoding="utf-8")
    print(page)


if __name__ == "__main__":
    main()
