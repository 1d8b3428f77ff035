"""Put a twin together from what the stages found, and keep it in the run folder beside what the user changed there."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.judge import Judged
from twin.errors import InputError
from twin.files.text import read_json
from twin.names import legal_name
from twin.physics import keep_known
from twin.runs.manifest import MANIFEST, update_manifest
from twin.runs.stages import Run
from twin.scene import (
    STATIC_LABEL,
    UNKNOWN_LABEL,
    Mesh,
    Part,
    Recorded,
    Revolute,
    StaticPart,
    Texture,
    Trajectory,
    Twin,
)
from twin.storage import aside_name, digest, keep_aside, load, save
from twin.storage.texture import same_textures
from twin.verdict import Verdict, of_twin, verdict_document


def assemble(
    recording: Recording,
    cameras: Trajectory,
    static: Mesh,
    parts: Sequence[FinishedPart],
    labels: Mapping[int, NDArray[np.uint8]],
    provenance: Mapping[str, Any],
    judged: Judged,
    moved: Sequence[MovingPart],
    textures: Mapping[int, Texture],
) -> Twin:
    """The twin, without mass or collision geometry yet (`twin.physics`, `twin.collision` add them).

    moved: all parts that were found. Those that are refused are no parts of it: their pixels count as unknown, and verdict and
    provenance tell of them. They are told by the id that they would have, under the names that they would have.
    textures: of the static scene and of parts, by label id.
    """
    name = legal_name(recording.name)
    taken = [name, "static"]
    names = {}
    for part in moved:
        kind = "drawer" if part.joint.kind == "prismatic" else "door"
        names[part.id] = legal_name(f"{kind}_{part.id}", taken)
        taken.append(names[part.id])
    refused = {p.id: names[p.id] for p in moved if judged.parts[p.id].level == "refused"}
    finished = [
        Part(
            id=part.moving.id,
            name=names[part.moving.id],
            mesh=replace(part.mesh, texture=textures.get(part.moving.id)),
            joint=part.moving.joint.with_pivot(part.mesh.area_centroid),
            motion=part.moving.motion,
            contact=part.contact,
            limits_source="observed: quantiles of the smoothed state",
            closed_source=part.closed_source,
            type_source=part.type_source,
            verdict=judged.parts[part.moving.id],
        )
        for part in parts
        if part.moving.id not in refused
    ]
    left_out = [_left_out(p, names[p.id], judged.parts[p.id]) for p in moved if p.id in refused]
    return Twin(
        name=name,
        static=StaticPart(legal_name("static", []), replace(static, texture=textures.get(STATIC_LABEL))),
        parts=tuple(finished),
        cameras=cameras,
        recorded=Recorded(Path(recording.source).name, len(recording), recording.fingerprint),
        provenance={**provenance, "refused": left_out} if left_out else provenance,
        labels=_without(labels, tuple(refused)),
        verdict=of_twin(
            {p.name: judged.parts[p.id] for p in finished},
            {name: judged.parts[k] for k, name in refused.items()},
            judged.scene,
        ),
    )


def _left_out(part: MovingPart, name: str, verdict: Verdict) -> dict[str, Any]:
    """What provenance says of a refused part: JSON types, in the world with the state counted from the first frame."""
    joint = part.joint
    pivot = joint.pivot.tolist() if isinstance(joint, Revolute) else None
    told = {"id": part.id, "name": name, "type": joint.kind, "axis": joint.axis.tolist(), "pivot": pivot}
    return {**told, "lower": joint.lower, "upper": joint.upper, "verdict": verdict_document(verdict)}


def _without(labels: Mapping[int, NDArray[np.uint8]], ids: Sequence[int]) -> Mapping[int, NDArray[np.uint8]]:
    """Label images in which the pixels of these parts are unknown: whether they are static is not known either."""
    if not ids:
        return labels
    table = np.arange(256, dtype=np.uint8)
    table[list(ids)] = UNKNOWN_LABEL
    return {frame: table[image] for frame, image in labels.items()}


def keep_twin(run: Run, twin: Twin, out: Path) -> Twin:
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
            dressed = _with_textures(earlier, twin)
            if not same_textures(dressed, earlier):
                save(dressed, folder)
            update_manifest(out, twin=found)
            return dressed
        known = keep_known(twin, earlier)
        if there != before or (earlier.extra and not known.extra):
            run.warn(
                f"{folder} was changed since it was made: the earlier one is kept in {keep_aside(folder)}"
            )
        twin = known
    save(twin, folder)
    update_manifest(out, twin=found)
    return twin


def _with_textures(earlier: Twin, twin: Twin) -> Twin:
    """The earlier twin with the textures of the new one, wherever their meshes have the same faces: a digest knows nothing of them."""

    def dressed(old: Mesh, new: Mesh) -> Mesh:
        same = np.array_equal(old.faces, new.faces) and np.array_equal(old.vertices, new.vertices)
        return replace(old, texture=new.texture) if same else old

    new = {p.id: p.mesh for p in twin.parts}
    parts = tuple(replace(p, mesh=dressed(p.mesh, new.get(p.id, p.mesh))) for p in earlier.parts)
    static = replace(earlier.static, mesh=dressed(earlier.static.mesh, twin.static.mesh))
    return replace(earlier, static=static, parts=parts)


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


def say_where(recording: Recording, out: Path) -> None:
    """Note in the manifest where the recording lies, for a film that shows its frames again.

    Relative to the run folder, so that it holds when both are moved together. twin.json, whose bytes don't depend on the
    machine, knows the recording by its fingerprint only.
    """
    if recording.path is None:
        return

    def seen_from_run(path: Path | str) -> str:
        return Path(os.path.relpath(Path(path).resolve(), out.resolve())).as_posix()

    told = dict(recording.opened_with)
    if "calibration" in told:
        told["calibration"] = seen_from_run(told["calibration"])
    update_manifest(out, recording=seen_from_run(recording.path), opened_with=told)


def keep_key_frames(twin: Twin, recording: Recording, out: Path) -> None:
    from twin.report import pick_key_frames, save_key_frames

    chosen = pick_key_frames(twin)
    save_key_frames(out, {f: recording.color(f) for f in chosen}, recording.intrinsics.matrix)
