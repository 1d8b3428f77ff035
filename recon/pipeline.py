"""The chain: one recording in, a twin out, stage by stage.

The stages follow FunREC (CVPR 2026); docs/method.md says what each takes from the paper and where it leaves
it. Each is a function of typed inputs and its settings, which its folder declares with name and version.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from recon.config import ReconConfig
from recon.contact.finish_parts import CONTACT, finish_parts
from recon.inspection.findings import as_reason, doubts, only_after
from recon.inspection.inspect import INSPECTION, quick_findings
from recon.interaction.interaction import Interaction
from recon.interaction.joints.clustering.clusters import require_hdbscan
from recon.interaction.joints.type_selection import TypeHint
from recon.interaction.parts.words import SAID
from recon.models.joint_hint import JointHint
from recon.readers import open_recording
from recon.recording import Recording
from recon.recording.decoded import decoded_once
from recon.recording.said import Said, require_said
from recon.stages.survey import Surveyed, survey
from recon.texture.handle_section import HANDLE, handle_sections, with_handles
from recon.texture.photo_textures import TEXTURE, photo_textures
from recon.verdict.assemble import assemble, earlier_twin, given_names, keep_key_frames, keep_twin, say_where
from recon.verdict.completion import COMPLETION, inferred_layers, with_layers
from recon.verdict.judge import VERDICT, Fault, judge
from recon.windows.windows import is_long
from twin.cause import Cause
from twin.edits import found_folder, said_before
from twin.errors import InputError, nearest_name
from twin.level import DOUBTED
from twin.physics import MaterialTable, read_materials, with_physics
from twin.runs.chain import Chain
from twin.runs.codec import TreeCodec
from twin.runs.manifest import versions
from twin.runs.progress import Counted, default_progress
from twin.runs.settings import as_dict
from twin.runs.stages import Progress, Run
from twin.scene import Twin
from twin.storage import require_place

T = TypeVar("T")

# Seconds of a clip on two cores, for the time left: medians of benchmarks/speed.md. Only ratios count.
_SECONDS = {
    "inspect": 4.6, "tracks": 5.7, "cameras": 2.6, "gravity": 0.2, "noise": 0.2, "windows": 0.1, "loops": 0.1, "path": 0.1, "motion": 7.3, "refine": 5.9, "labels": 5.2, "polish": 2.1,
    "merge": 0.1, "fusion": 2.4, "up": 0.5, "contact": 0.8, "texture": 19.8, "verdict": 1.5, "handle": 0.1, "completion": 5.0,
}  # fmt: skip
# The same of a walk of 45 s, whose interactions count as one.
_SECONDS_OF_WALK = {
    "inspect": 11.0, "frames": 3.0, "corners": 28.0, "tracks": 0.5, "submaps": 20.0, "cameras": 2.0, "gravity": 0.2, "noise": 0.3, "windows": 5.0, "loops": 3.0, "path": 0.5,
    "interactions": 75.0, "recall": 6.0, "merge": 2.0, "fusion": 19.0, "up": 1.0, "contact": 3.0, "texture": 31.0, "verdict": 8.0, "handle": 0.3, "completion": 35.0,
}  # fmt: skip


def reconstruct(
    recording: Recording | Path | str,
    config: ReconConfig | None = None,
    *,
    out: Path | str | None = None,
    progress: Progress | bool | None = None,
    hint: JointHint | None = None,
) -> Twin:
    """Reconstruct a twin.

    Args:
        recording: a recording, or the path of one, which is opened with `open_recording`.
        config: settings by stage, and what the user says of the recording (`config.said`); None takes the
            defaults.
        out: run folder; stages found there are reused when nothing they depend on has changed, and the twin
            is saved there. None keeps everything in memory.
        progress: told about every stage, with its number and the time left; True shows it on standard error,
            terminal or not, False nothing. Left out, bars appear on a terminal.
        hint: says which joint types to expect; asked once, before anything else. Clear motion overrules it.

    Raises InputError, ConfigError, ReconstructionError, MissingDependencyError: in one line what is wrong and
    what to try. Stages that were done stay in `out`.
    """
    config = config or ReconConfig()
    out = None if out is None else Path(out)
    materials = read_materials()  # this and what follows before anything that takes minutes
    if config.motion.method == "clusters":
        require_hdbscan()
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    if out is not None:  # what was said of this recording before holds
        config = replace(config, said=config.said.after(said_before(out, recording.fingerprint)))
    require_said(config.said, recording)
    if out is not None:
        require_place(out / "twin")
    seconds = _SECONDS_OF_WALK if is_long(recording) else _SECONDS
    with (
        default_progress(progress) as shown,
        # What is said is kept with the edits, so that it can be taken back.
        Run(out, recording.fingerprint, Counted(shown, seconds), replace(config, said=Said())) as run,
        ExitStack() as files,
    ):
        for note in recording.warnings:
            run.warn(note)
        recording = files.enter_context(decoded_once(recording, out))
        hints = hint(recording, None if out is None else out / "stages" / "vlm") if hint is not None else ()
        earlier = None if out is None else earlier_twin(run, found_folder(out))
        twin = _run(run, recording, config, hints, materials, earlier)
        if out is not None:
            twin = keep_twin(run, twin, out, config.said.texts)
            keep_key_frames(twin, recording, out)
            say_where(recording, out)
    return twin


def read_stage(run: Path | str, name: str) -> Any:
    """What a stage of a run found, as the run folder keeps it: `read_stage("RUN", "tracks")` the `Tracks`,
    "labels" the label images (H, W) by frame, in which a part that was refused still has its id.

    Raises InputError for an unknown stage or one the run has not kept, CodecError for a damaged one.
    """
    known = [*_SECONDS, SAID.name, *(n for n in _SECONDS_OF_WALK if n not in _SECONDS)]
    if name not in known:
        close = nearest_name(name, known)
        hint = f"did you mean {close!r}? " if close else ""
        raise InputError(f"there is no stage {name!r}", f"{hint}stages: {', '.join(known)}")
    folder = next(iter(sorted(Path(run).glob(f"stages/[0-9][0-9]_{name}"))), None)
    if folder is None:
        raise InputError(
            f"{Path(run) / 'stages'} holds no stage {name!r}",
            "give the folder of a run that `twin reconstruct` made",
        )
    return TreeCodec().load(folder)


def _run(
    run: Run,
    recording: Recording,
    c: ReconConfig,
    hints: Sequence[TypeHint],
    materials: MaterialTable,
    earlier: Twin | None = None,
) -> Twin:
    """earlier: the twin of the run folder, whose parts keep their names."""
    stage = Chain(run, c)
    # What is wrong with the recording, by the checks of `twin inspect` that take seconds.
    wrong = stage(INSPECTION, [], lambda: quick_findings(recording))
    surveyed = survey(stage, recording, hints)
    made = _provenance(c, hints, surveyed.doubts)
    given = given_names(earlier, recording, surveyed.labels) if earlier is not None else {}
    twin = _judged_twin(stage, recording, surveyed, wrong.value, made, given)
    return with_physics(twin, table=materials)


def _judged_twin(
    stage: Chain,
    recording: Recording,
    surveyed: Surveyed,
    wrong: tuple[Cause, ...],
    made: Mapping[str, Any],
    given: Mapping[int, str],
) -> Twin:
    """The last stages, and the twin of what they leave."""
    c, loop, world, images = stage.config, stage.run.loop, surveyed.world, surveyed.labels
    noise, cameras, interactions = surveyed.noise, world.cameras, world.interactions
    parts, scene = world.parts, world.fused
    static, sigma = scene.static, noise.value
    faults = tuple(Fault(as_reason(f), only_after(f)) for f in wrong if doubts(f))  # join the key only if any
    # Joint limits from the closed end, and where the hand held the part.
    finished = stage(
        CONTACT,
        surveyed.reads,
        lambda: finish_parts(recording, cameras, images, _sources(interactions), parts, scene, c.contact),
    )
    # Photographs on the meshes.
    dressed = stage(
        TEXTURE,
        [*surveyed.reads, noise, finished],
        lambda: photo_textures(
            recording, cameras, images, static, finished.value, c.texture, sigma, progress=loop("texture")
        ),
    )
    # What each part is worth, by numbers that need no truth.
    judged = stage(
        VERDICT,
        [*surveyed.reads, finished],
        lambda: judge(recording, cameras, images, interactions, parts, scene, finished.value, faults),
        *([faults] if faults else []),
    )
    doubt = surveyed.upright.doubt
    verdict = judged.value if doubt is None else replace(judged.value, scene=(doubt, *judged.value.scene))
    twin = assemble(
        recording, cameras, static, finished.value, images, made, verdict, parts, dressed.value, given
    )
    # How thick handles are, by their outline in photographs.
    reads = [*surveyed.reads, finished, judged]
    sections = stage(HANDLE, reads, lambda: handle_sections(twin, recording))
    twin = with_handles(twin, sections.value)
    # What no camera saw of the furniture, from which an export takes what it shows.
    reads = [*reads, dressed, sections]
    names = [p.name for p in twin.parts]  # pieces carry them
    layers = stage(COMPLETION, reads, lambda: inferred_layers(twin), names)
    return with_layers(twin, layers.value)


def _sources(interactions: Sequence[Interaction]) -> dict[int, str]:
    """Why the joint of each part, by id, has its type: by the first interaction that found it."""
    told = [(t.part.id, t.type_source) for i in interactions for t in i.found.parts]
    return dict(reversed(told))


def _provenance(config: ReconConfig, hints: Sequence[TypeHint], up_doubted: Sequence[str]) -> dict[str, Any]:
    made: dict[str, Any] = {"versions": versions(), "config": as_dict(config)}
    told = {"joint_hints": as_dict(hints), "said": config.said.texts, DOUBTED: list(up_doubted)}
    return made | {name: what for name, what in told.items() if what}
