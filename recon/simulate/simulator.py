"""The simulator: an articulated MJCF scene in, an egocentric RGB-D recording with exact truth out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from recon.simulate.config import SimulateConfig, Staging
from recon.simulate.joints import load_model, scene_path
from recon.simulate.mjcf import OPENING_SHARE, travel
from recon.simulate.picture import Picture
from recon.simulate.record import late_depth, new_recording, write_frame, write_intrinsics
from recon.simulate.render import View
from recon.simulate.script import Script
from recon.simulate.sensors.colour import colour_image, exposure
from recon.simulate.sensors.depth_camera import DepthCamera
from recon.simulate.sensors.frame import Frame
from recon.simulate.stage import Stage
from recon.simulate.staged import Staged
from recon.simulate.timeline import REST_AFTER, opening_episode
from recon.simulate.truth import write_truth
from twin.errors import ConfigError, InputError
from twin.runs.threads import each

Progress = Callable[[int, int], None]
DepthLag = int | Literal["drawn"]
LAGGING = 10  # the stream of random numbers that a drawn lag is from
MOST_LAG = 3  # frames of a drawn lag: what recorders and tools that cut videos leave


def simulate(
    scene: Path | str,
    joint: str,
    out: Path | str,
    config: SimulateConfig | None = None,
    progress: Progress | None = None,
    depth_lag: DepthLag = 0,
) -> Path:
    """Render a person opening one part of an MJCF scene.

    Args:
        scene: MJCF file with hinge or slide joints, or "kitchen" for the Franka Kitchen (extra `simulate`).
        joint: name of the joint to move.
        out: folder of the recording; it must be new or empty.
        config: see `SimulateConfig`.
        progress: called with (frames done, frames) after each frame.
        depth_lag: frames by which depth lags behind colour (early: negative), or "drawn".

    Returns:
        `out`. The layout is the native one (color/, depth/, intrinsic.json, timestamps.txt) and truth/.

    Raises:
        InputError: scene, joint, handle or folder can't be used.
        ConfigError: the settings don't fit the joint.
        MissingDependencyError: the Franka Kitchen is asked for but not installed.
    """
    config = config or SimulateConfig()
    return record(opening(scene_path(scene), joint, config), Path(out), progress, depth_lag)


def opening(scene: Path, joint: str, config: SimulateConfig) -> Stage:
    """The part of `joint`, closed, is opened once. Raises InputError, ConfigError as `simulate`."""
    model = load_model(scene)
    episode = opening_episode(joint, _opening(model, joint, config), config)
    return Stage(Script(model, str(scene), (episode,), REST_AFTER), Staging.of(config))


def record(stage: Staged, folder: Path, progress: Progress | None = None, depth_lag: DepthLag = 0) -> Path:
    """Render and write all frames of a stage with their truth, in threads; each frame is made by itself, so
    that their number changes no byte. Raises InputError when the folder can't be used.
    """
    config, faults = stage.config, stage.config.picture
    lag = drawn_lag(config.seed) if depth_lag == "drawn" else depth_lag
    if abs(lag) >= stage.frames:
        raise InputError(
            f"a depth lag of {lag} frames is longer than the recording", f"it has {stage.frames} frames"
        )
    picture = Picture(config, stage.camera, stage.frames)
    sensor = DepthCamera(config.sensor, stage.camera, config.depth_noise, config.seed)
    with new_recording(folder) as staged:
        first = stage.render(0)
        others = [stage.render(i).colour for i in stage.metered if i > 0]
        gain = exposure(np.stack([first.colour, *others]))

        def shots() -> Iterator[tuple[int, Callable[[], View]]]:
            yield 0, lambda: first
            for i in range(1, stage.frames):
                yield i, stage.prepared(i)

        def take(shot: tuple[int, Callable[[], View]]) -> None:
            i, rendered = shot
            view = rendered()
            rng = np.random.default_rng([config.seed, 7, i])
            drift = 1.0 + 0.015 * np.sin(0.11 * i) * config.colour_noise
            if stage.covered(i):
                view = view.dark()
            linear = picture.exposed(view.colour, stage.flow(i, view)) if picture.moves else view.colour
            gains = gain * drift * picture.brightness(i)
            colour = colour_image(linear, gains, config.colour_noise, rng, faults.light)
            depth = sensor.image(Frame(view, stage.view_directions(i), colour, i, rng))
            if stage.covered(i):
                depth = np.zeros_like(depth)
            write_frame(staged, i, colour, depth, view.labels, faults.jpeg_quality)

        for i, _ in enumerate(each(take, shots())):
            if progress is not None:
                progress(i + 1, stage.frames)
        late_depth(staged, lag)
        write_truth(staged, stage.truth(), stage.camera, lag)
        write_intrinsics(staged, stage.camera, faults.focal_error, faults.centre_error_px)
    return folder


def drawn_lag(seed: int) -> int:
    """1 to `MOST_LAG` frames, by a random stream of its own, used for nothing else."""
    return int(np.random.default_rng([seed, LAGGING]).integers(1, MOST_LAG + 1))


def _opening(model: mujoco.MjModel, joint: str, config: SimulateConfig) -> float:
    kind, span = travel(model, joint)
    if config.opening is None:
        return OPENING_SHARE * span
    if config.opening > span + 1e-9:
        unit_name = "rad" if kind == "revolute" else "m"
        raise ConfigError(
            f"simulate.opening = {config.opening} {unit_name} is beyond the range of joint {joint!r}",
            f"use at most {span:.4g} {unit_name}",
        )
    return config.opening
