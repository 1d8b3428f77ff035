"""The chain: one recording in, a twin out. Each stage is a function of typed inputs and its own settings."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from recon.assemble import FinishedPart, assemble
from recon.cameras.gravity import find_gravity
from recon.cameras.poses import estimate_cameras
from recon.config import ReconConfig
from recon.contact.closed_end import find_closed_end, rebase, rebase_mesh
from recon.contact.find_contact import find_contact
from recon.fusion.fuse import FusedScene, fuse
from recon.joints.type_selection import TypeHint
from recon.labels.label_frames import label_frames
from recon.models.joint_hint import JointHint
from recon.motion.find_parts import FoundParts, find_parts
from recon.moving_part import MovingPart
from recon.readers import open_recording
from recon.recording import Recording
from recon.refine.refine_parts import refine_parts
from recon.tracking.tracks import Tracks, track_points
from twin import geometry as geo
from twin.errors import InputError
from twin.files.text import read_json
from twin.physics import MaterialTable, keep_known, read_materials, with_physics
from twin.runs.manifest import MANIFEST, update_manifest, versions
from twin.runs.progress import default_progress
from twin.runs.settings import as_dict
from twin.runs.stages import Progress, Run
from twin.scene import Trajectory, Twin
from twin.storage import aside_name, digest, keep_aside, load, require_place, save

T = TypeVar("T")
Labels = dict[int, NDArray[np.uint8]]


def reconstruct(
    recording: Recording | Path | str,
    config: ReconConfig | None = None,
    *,
    out: Path | str | None = None,
    progress: Progress | None = None,
    hint: JointHint | None = None,
) -> Twin:
    """Reconstruct a twin.

    Args:
        recording: a recording, or the path of one, which is opened with `open_recording`.
        config: settings by stage; None takes the defaults.
        out: run folder; stages found there are reused when nothing they depend on has changed, and the twin is saved
            there. None keeps everything in memory.
        progress: told about every stage; without it a bar appears on a terminal.
        hint: says which joint types to expect; asked once, before anything else. Clear motion overrules it.

    Raises InputError, ConfigError, ReconstructionError: in one line what is wrong and what to try. Stages that were done stay in `out`.
    """
    config = config or ReconConfig()
    materials = read_materials()  # before anything that takes minutes
    out = None if out is None else Path(out)
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    if out is not None:
        require_place(out / "twin")
    with default_progress(progress) as told, Run(out, recording.fingerprint, told, config) as run:
        for note in recording.warnings:
            run.warn(note)
        hints = hint(recording, None if out is None else out / "stages" / "vlm") if hint is not None else ()
        twin = _run(run, recording, config, hints, materials)
        if out is not None:
            twin = _kept(run, twin, out)
            _keep_key_frames(twin, recording, out)
            _say_where(recording, out)
    return twin


def _run(
    run: Run,
    recording: Recording,
    config: ReconConfig,
    hints: Sequence[TypeHint] = (),
    materials: MaterialTable | None = None,
) -> Twin:
    tracks = run.stage(
        "tracks", 1, config.tracks, [], lambda: track_points(recording, config.tracks, _Bar(run, "tracks"))
    )
    cameras = run.stage(
        "cameras", 1, config.cameras, [tracks], lambda: _cameras(run, recording, tracks.value, config)
    )
    upright = run.stage(
        "gravity", 1, config.gravity, [cameras], lambda: _upright(recording, cameras.value, config)
    )
    found = run.stage(
        "motion",
        9,
        (config.motion, hints) if hints else config.motion,
        [tracks, upright],
        lambda: find_parts(recording, tracks.value, upright.value, config.motion, hints),
    )
    refined = run.stage(
        "refine",
        8,
        (config.refine, config.labels, config.motion.interval),
        [upright, found],
        lambda: _refined(run, recording, upright.value, found.value, config),
    )
    labels = run.stage(
        "labels",
        2,
        config.labels,
        [upright, refined],
        lambda: label_frames(
            recording, upright.value, refined.value, config.labels, progress=_Bar(run, "labels")
        ),
    )
    polished = run.stage(
        "polish",
        3,
        (config.refine, config.motion.interval),
        [upright, found, refined, labels],
        lambda: _polished(recording, upright.value, found.value, refined.value, labels.value, config),
    )
    fused = run.stage(
        "fusion",
        2,
        config.fusion,
        [upright, polished, labels],
        lambda: fuse(
            recording,
            upright.value,
            labels.value,
            polished.value,
            config.fusion,
            progress=_Bar(run, "fusion"),
        ),
    )
    finished = run.stage(
        "contact",
        1,
        (config.closed_end, config.contact),
        [upright, found, polished, labels, fused],
        lambda: _finish(
            recording, upright.value, found.value, polished.value, labels.value, fused.value, config
        ),
    )
    provenance = {"versions": versions(), "config": as_dict(config)}
    if hints:
        provenance["joint_hints"] = as_dict(hints)
    twin = assemble(recording, upright.value, fused.value.static, finished.value, labels.value, provenance)
    return with_physics(twin, table=materials)


@dataclass(frozen=True)
class _Bar:
    """Tells a run how far a stage's loop is."""

    run: Run
    stage: str

    def __call__(self, items: Iterable[T], what: str) -> Iterable[T]:
        known = list(items)
        for k, item in enumerate(known):
            self.run.report(self.stage, k / max(len(known), 1), what)
            yield item


def _cameras(run: Run, recording: Recording, tracks: Tracks, config: ReconConfig) -> Trajectory:
    if config.cameras.use_known_poses:
        if recording.poses is None:
            raise InputError(
                f"{recording.source} holds no camera poses",
                "leave cameras.use_known_poses off to estimate them",
            )
        return recording.poses
    found = estimate_cameras(
        tracks, recording.times, recording.intrinsics.fx, config.cameras, _Bar(run, "cameras")
    )
    lost = len(recording) - len(found.frames)
    if lost:
        warnings.warn(f"{lost} of {len(recording)} frames have no camera pose", stacklevel=2)
    return found


def _upright(recording: Recording, cameras: Trajectory, config: ReconConfig) -> Trajectory:
    """Cameras in a world whose z axis points up."""
    gravity = find_gravity(recording, cameras, config.gravity)
    for note in gravity.warnings:
        warnings.warn(note, stacklevel=2)
    return cameras.transformed(geo.make_pose(gravity.R_world_start))


def _refined(
    run: Run, recording: Recording, cameras: Trajectory, found: FoundParts, config: ReconConfig
) -> tuple[MovingPart, ...]:
    """Labels with the joints found so far, then joints and states refined with every labelled pixel."""
    parts = [p.part for p in found.parts]
    # As dense as the final ones: a door's far face is in few frames. Denser adds time and no accuracy.
    first = replace(config.labels, every=max(config.labels.every, 4))
    labels = label_frames(recording, cameras, parts, first, progress=_Bar(run, "refine"))
    return refine_parts(recording, cameras, labels, found, config.refine, config.motion.interval)


def _polished(
    recording: Recording,
    cameras: Trajectory,
    found: FoundParts,
    refined: Sequence[MovingPart],
    labels: Labels,
    config: ReconConfig,
) -> tuple[MovingPart, ...]:
    """Refined once more with the final labels, which show what the first ones missed, by the last, tight gates."""
    tracks = tuple(replace(t, part=p) for t, p in zip(found.parts, refined, strict=True))
    tight = replace(config.refine, gates=config.refine.gates[-3:])
    return refine_parts(
        recording, cameras, labels, replace(found, parts=tracks), tight, config.motion.interval
    )


def _finish(
    recording: Recording,
    cameras: Trajectory,
    found: FoundParts,
    parts: Sequence[MovingPart],
    labels: Labels,
    fused: FusedScene,
    config: ReconConfig,
) -> tuple[FinishedPart, ...]:
    """Count each part from its closed end and find where the hand held it."""
    finished = []
    for tracks, part in zip(found.parts, parts, strict=True):
        mesh = fused.parts.get(part.id)
        if mesh is None:
            warnings.warn(
                f"part {part.id} has no surface: too few of its pixels could be labelled", stacklevel=2
            )
            continue
        closed = find_closed_end(part, mesh, fused.static, recording, cameras, labels, config.closed_end)
        based, based_mesh = rebase(part, closed), rebase_mesh(mesh, part, closed)
        contact = find_contact(recording, cameras, labels, based, based_mesh, config.contact)
        finished.append(FinishedPart(based, based_mesh, contact, tracks.type_source, closed.source))
    return tuple(finished)


def _kept(run: Run, twin: Twin, out: Path) -> Twin:
    """Save the twin into the run folder and return what stands there then.

    A twin that the user changed since it was reconstructed is not lost: it stays where the result is the same as before, and
    is kept beside the new one where it is not. What was measured or added about its parts goes over to the new one.
    """
    folder, found = out / "twin", digest(twin)
    earlier = _earlier_twin(run, folder)
    before = read_json(out / MANIFEST).get("twin")
    if earlier is not None:
        there = digest(earlier)
        if found in (before, there):
            if there != found:
                run.warn(f"{folder} was changed since and stays as it is: the result is the same as before")
            update_manifest(out, twin=found)
            return earlier
        known = keep_known(twin, earlier)
        if there != before or (earlier.extra and not known.extra):
            run.warn(
                f"{folder} was changed since it was made: the earlier one is kept in {keep_aside(folder)}"
            )
        twin = known
    save(twin, folder)
    update_manifest(out, twin=found)
    return twin


def _earlier_twin(run: Run, folder: Path) -> Twin | None:
    if not (folder / "twin.json").is_file():
        return None
    try:
        return load(folder)
    except InputError as e:
        aside = aside_name(folder)
        folder.rename(aside)
        run.warn(f"the earlier twin can't be read and is kept in {aside}: {e.problem}")
        return None


def _say_where(recording: Recording, out: Path) -> None:
    """Note in the manifest where the recording lies, for a film that shows its frames again.

    Relative to the run folder, so that it holds when both are moved together. twin.json, whose bytes don't depend on the
    machine, knows the recording by its fingerprint only.
    """
    if recording.path is not None:
        path = os.path.relpath(Path(recording.path).resolve(), out.resolve())
        update_manifest(out, recording=Path(path).as_posix())


def _keep_key_frames(twin: Twin, recording: Recording, out: Path) -> None:
    from twin.report import pick_key_frames, save_key_frames

    chosen = pick_key_frames(twin)
    save_key_frames(out, {f: recording.frame(f).color for f in chosen}, recording.intrinsics.matrix)
