"""Put a twin together from what the stages found, and keep it in the run folder with the user's changes."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.contact.finish_parts import FinishedPart
from recon.interaction.parts.moving_part import MovingPart
from recon.recording import Recording
from recon.verdict.judge import Judged
from twin.completion.frame import kind_by_joint, viewer
from twin.completion.part_names import part_names
from twin.edits import found_folder, keep, kept_aside, read, with_said
from twin.errors import InputError
from twin.files.text import read_json
from twin.names import legal_name
from twin.physics import keep_known
from twin.runs.manifest import EDITS, MANIFEST, update_manifest
from twin.runs.stages import Run
from twin.scene import (
    FIRST_PART_ID,
    HAND_LABEL,
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

# Intersection over union of one part's pixels in two twins: from half on, no other part has as many.
_SAME = 0.5


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
    given: Mapping[int, str],
) -> Twin:
    """The twin, without mass or collision geometry yet (`twin.physics`, `twin.collision` add them).

    moved: all parts that were found. Those that are refused are no parts of it: their pixels count as
    unknown, and verdict and provenance tell of them. They are told by the id and the name that they would
    have. textures: of the static scene and of parts, by label id. given: names that parts keep, by id.
    """
    name = legal_name(recording.name)
    gone = [p for p in moved if judged.parts[p.id].level == "refused"]
    left = [p for p in parts if judged.parts[p.moving.id].level != "refused"]
    carriers = {p.moving.id for p in left}
    finished = [
        Part(
            id=part.moving.id,
            name="part",
            mesh=replace(part.mesh, texture=textures.get(part.moving.id)),
            joint=part.moving.joint.with_pivot(part.mesh.area_centroid),
            motion=part.moving.motion,
            contact=part.contact,
            limits_source="observed: quantiles of the smoothed state",
            closed_source=part.closed.source,
            type_source=part.type_source,
            verdict=judged.parts[part.moving.id],
            parent=None if part.moving.carrier is None else part.moving.carrier.id,
        )
        for part in (_carried_by(p, carriers) for p in left)
    ]
    names = part_names(finished, viewer(cameras), given, [name, "static"])
    finished = [replace(p, name=names[p.id]) for p in finished]
    refused: dict[int, str] = {}
    for part in gone:
        taken = [name, "static", *names.values(), *refused.values()]
        refused[part.id] = legal_name(kind_by_joint(part.joint), taken)
    left_out = [_left_out(p, refused[p.id], judged.parts[p.id]) for p in gone]
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


def _carried_by(part: FinishedPart, carriers: Collection[int]) -> FinishedPart:
    """A part that stands in the static scene unless it is mounted on one of these."""
    carrier = part.moving.carrier
    return part if carrier is None or carrier.id in carriers else part.standing()


def given_names(
    earlier: Twin | None, recording: Recording, labels: Mapping[int, NDArray[np.uint8]]
) -> dict[int, str]:
    """Names of the parts of an earlier twin of the recording, by the id of their pixels' part now."""
    recorded = None if earlier is None else earlier.recorded
    if earlier is None or recorded is None or recorded.fingerprint != recording.fingerprint:
        return {}
    both = np.zeros((256, 256), np.int64)  # pixels by their labels then and now
    for frame in sorted(set(labels) & set(earlier.labels)):
        then, now = earlier.labels[frame], labels[frame]
        if then.shape == now.shape:
            both += np.bincount(256 * then.ravel().astype(np.int64) + now.ravel(), minlength=1 << 16).reshape(
                256, 256
            )
    either = both.sum(axis=1)[:, None] + both.sum(axis=0)[None] - both
    part_ids = range(FIRST_PART_ID, HAND_LABEL)
    same = both > _SAME * either  # at most one of each row and column, as _SAME is half
    return {int(k): p.name for p in earlier.parts for k in np.flatnonzero(same[p.id]) if k in part_ids}


def _left_out(part: MovingPart, name: str, verdict: Verdict) -> dict[str, Any]:
    """What provenance says of a refused part: JSON types, in the world, states from the first frame on."""
    joint = part.joint
    pivot = joint.pivot.tolist() if isinstance(joint, Revolute) else None
    told = {"id": part.id, "name": name, "type": joint.kind, "axis": joint.axis.tolist(), "pivot": pivot}
    return {**told, "lower": joint.lower, "upper": joint.upper, "verdict": verdict_document(verdict)}


def _without(labels: Mapping[int, NDArray[np.uint8]], ids: Sequence[int]) -> Mapping[int, NDArray[np.uint8]]:
    """Label images in which the pixels of these parts are unknown, static ones included."""
    if not ids:
        return labels
    table = np.arange(256, dtype=np.uint8)
    table[list(ids)] = UNKNOWN_LABEL
    return {frame: table[image] for frame, image in labels.items()}


def keep_twin(run: Run, twin: Twin, out: Path, said: Sequence[str] = ()) -> Twin:
    """Save the twin into the run folder and return what stands there then: with the user's edits, those that
    still fit; the others are told. said: the user's word on the recording, which is kept with the edits.

    A twin that the user changed otherwise since it was reconstructed is not lost: it stays where the result
    is the same as before, and is kept beside the new one where it is not. What was measured or added about
    its parts goes over to the new one.
    """
    by_hand = kept_aside(out)
    kept = _keep_found(run, twin, found_folder(out), out)
    try:
        edits = with_said(read(out, kept), said)
    except InputError as e:
        aside = aside_name(out / EDITS)
        (out / EDITS).rename(aside)
        run.warn(f"the edits are kept in {aside} and not made: {e.problem}")
        edits = with_said([], said)
    result = keep(out, kept, edits, by_hand)
    for text in result.warnings:
        run.warn(text)
    return result.twin


def _keep_found(run: Run, twin: Twin, folder: Path, out: Path) -> Twin:
    """Save the twin as it was found into its folder of the run, as `keep_twin` does."""
    found = digest(twin)
    earlier = earlier_twin(run, folder)
    before = read_json(out / MANIFEST).get("twin")
    if earlier is not None:
        there = digest(earlier)
        if found in (before, there):
            if there != found:
                run.warn(f"{folder} was changed since and stays as it is: the result is the same as before")
            same = _with_said(_with_textures(earlier, twin), twin)
            if not same_textures(same, earlier) or same.provenance != earlier.provenance:
                save(same, folder)
            update_manifest(out, twin=found)
            return same
        known = keep_known(twin, earlier)
        if there != before or (earlier.extra and not known.extra):
            run.warn(
                f"{folder} was changed since it was made: the earlier one is kept in {keep_aside(folder)}"
            )
        twin = known
    save(twin, folder)
    update_manifest(out, twin=found)
    return twin


def _with_said(earlier: Twin, twin: Twin) -> Twin:
    """The earlier twin with the user's word on the recording as it was heard now, which digests skip."""
    kept = {k: v for k, v in earlier.provenance.items() if k != "said"}
    heard = {k: v for k, v in twin.provenance.items() if k == "said"}
    return replace(earlier, provenance=kept | heard)


def _with_textures(earlier: Twin, twin: Twin) -> Twin:
    """The earlier twin with the new one's textures where meshes have the same faces: digests skip them."""

    def retextured(old: Mesh, new: Mesh) -> Mesh:
        same = np.array_equal(old.faces, new.faces) and np.array_equal(old.vertices, new.vertices)
        return replace(old, texture=new.texture) if same else old

    new = {p.id: p.mesh for p in twin.parts}
    parts = tuple(replace(p, mesh=retextured(p.mesh, new.get(p.id, p.mesh))) for p in earlier.parts)
    static = replace(earlier.static, mesh=retextured(earlier.static.mesh, twin.static.mesh))
    return replace(earlier, static=static, parts=parts)


def earlier_twin(run: Run, folder: Path) -> Twin | None:
    """The twin in a folder, None without one; an unreadable one is kept aside, with a warning."""
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

    Relative to the run folder, so that it holds when both are moved together. twin.json, whose bytes don't
    depend on the machine, knows the recording by its fingerprint only.
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
    """Pictures of the recording for the page: the few that tell the story, and a film."""
    from twin.report import film_frames, pick_key_frames, save_film, save_key_frames

    save_film(out, film_frames(twin), recording.color)
    chosen = pick_key_frames(twin)
    save_key_frames(out, {f: recording.color(f) for f in chosen}, recording.intrinsics.matrix)
