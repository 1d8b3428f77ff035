"""Puts the page together: every block is left out when the run does not hold its material yet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from twin.edits import KINDS
from twin.edits.edit import edit_from
from twin.edits.values import SNAPS
from twin.errors import InputError, SceneError
from twin.files.paths import AnyPath
from twin.files.text import read_json, write_text
from twin.page.drawn import drawn_once
from twin.page.facts import numbers, part_facts
from twin.page.replays import Replays, replay_of, replays_of
from twin.page.template import template
from twin.page.viewer import scene_document, scene_glb, scripts, three_js
from twin.report.frames import Image, drawn_key_frames, part_color
from twin.report.pictures import jpeg, uri
from twin.report.plots import shown, state_plot, unit
from twin.report.sections import MARKS, PAGE, Section, load_section, require_own_page, twin_key
from twin.report.timeline import timeline
from twin.runs.manifest import MANIFEST, seconds_of, warnings_of
from twin.runs.threads import each
from twin.scene import Part, Twin
from twin.storage import load
from twin.verdict import unjudged

# layers of the scene, as viewer/scene.js names them, and what the page calls them
_LAYERS = {
    "seen": "seen", "evidence": "inferred, bounded", "assumed": "assumed", "collision": "collision shapes",
    "axes": "axes, grasp", "paths": "paths",
}  # fmt: skip
_SHOWN = ("seen", "evidence", "assumed", "axes")
VERBS = ("evaluate", "export", "check", "replay")
# what the page lacks of a run without a twin, and of a twin without a run
_NO_TWIN: dict[str, Any] = {
    "twin": None, "verdict": None, "unjudged": "", "said": "", "edits": [], "inferred": False, "parts": [], "timeline": "",
    "scene": None, "key_frames": [], "opening": [], "dollhouse": "", "plan": "",
}  # fmt: skip
_NO_RUN: dict[str, Any] = {
    "cards": [], "warnings": [], "sections": [], "replays": [], "stages": [], "versions": {}, "config": "",
}  # fmt: skip
STEPS = 2  # pictures from closed to open


def render(run: AnyPath) -> Path:
    """Write RUN/report.html, one file without outside references, and return its path.

    Everything there is shown: unfinished runs, twins without recording, the verbs' results. Raises InputError
    when `run` is no folder or holds somebody else's report.html, OSError when it can't be written.
    """
    run = Path(run)
    require_own_page(run)
    return written(run, gathered(run))


def written(run: Path, told: Mapping[str, Any]) -> Path:
    """Write RUN/report.html of what was gathered; its path. Raises as `render` does."""
    require_own_page(run)
    path = run / PAGE
    write_text(path, text_of(told))
    return path


def text_of(told: Mapping[str, Any], live: bool = False) -> str:
    """The page's text of what was gathered.

    live: with what edits the twin, for the server that takes the edits.
    """
    live = live and told["scene"] is not None
    context = {**told, "live": live, "scripts": scripts(live), "marks": MARKS, "snaps": tuple(SNAPS)}
    return str(template(Path(__file__).parent / "page.html.j2").render(context))


def gathered(run: Path) -> dict[str, Any]:
    """What a page shows of a run: reads all of it, and draws what was not drawn before.

    Raises InputError when `run` is no folder.
    """
    if not run.is_dir():
        raise InputError(f"{run} is not a run folder", "give the folder that `twin reconstruct -o` wrote")
    manifest = read_json(run / MANIFEST)
    twin = load(run) if (run / "twin" / "twin.json").is_file() else None
    key = twin_key(run)
    sections = [s for s in (load_section(run, verb) for verb in VERBS) if s is not None]
    replays = replays_of(run, twin) if twin else Replays()
    return {
        "name": twin.name if twin else run.resolve().name,
        **(_twin_of_run(run, twin, replays) if twin else _NO_TWIN),
        "cards": _cards(twin, manifest, sections),
        "warnings": _warnings(manifest),
        "sections": [{"it": s, "stale": bool(s.twin) and s.twin != key} for s in sections],
        "replays": [replay_of(run, p) for p in sorted((run / "replay").glob("*/*/replay.mp4"))],
        "stages": _stages(manifest),
        "versions": manifest.get("versions", {}),
        "config": _text(run / "config.toml"),
    }


def html_of(twin: Twin) -> str:
    """A page of a twin alone, without a run: its scene and its joints."""
    scene = _scene(None, twin, glb) if (glb := _glb(twin)["glb"]) else None
    return text_of({"name": twin.name, **_of_twin(twin, {"plots": {}}, scene, []), **_NO_RUN})


def _twin_of_run(run: Path, twin: Twin, replays: Replays) -> dict[str, Any]:
    pictures = drawn_once(run, twin, _drawn)
    glb = drawn_once(run, twin, _glb, "scene")["glb"]
    key_frames = [(k, jpeg(image)) for k, image in drawn_key_frames(run, twin)]
    scene = _scene(run, twin, glb, replays) if glb else None
    return _of_twin(twin, pictures, scene, key_frames)


def _of_twin(
    twin: Twin,
    pictures: Mapping[str, Any],
    scene: Mapping[str, Any] | None,
    key_frames: list[tuple[int, str]],
) -> dict[str, Any]:
    """What the page says of a twin."""
    return {
        **_NO_TWIN,
        "twin": twin,
        "verdict": twin.verdict,
        "unjudged": unjudged(twin),
        "said": _said(twin),
        "edits": _edits(twin),
        "inferred": twin.static.completion is not None,
        "parts": [_part(p, pictures) for p in twin.parts],
        "timeline": timeline(twin),
        "scene": scene,
        "key_frames": key_frames,
        **pictures,
    }


def _edits(twin: Twin) -> list[str]:
    rows = twin.provenance.get("edits", [])
    return [str(edit_from(row, KINDS, "twin.json, provenance.edits")) for row in rows]


def _said(twin: Twin) -> str:
    """The user's word on the recording, as the command line takes it."""
    return " ".join(twin.provenance.get("said", []))


def _cards(
    twin: Twin | None, manifest: Mapping[str, Any], sections: Iterable[Section]
) -> list[dict[str, str]]:
    """The line of figures at the top."""
    cards = []
    if twin is not None and twin.recorded is not None:
        cards.append({"value": str(twin.recorded.frames), "name": "frames"})
    if twin is not None:
        cards.append({"value": str(len(twin.parts)), "name": "moving part" + "s" * (len(twin.parts) != 1)})
    stages = manifest.get("stages", [])
    if stages:
        cards.append({"value": f"{seconds_of(stages):.0f} s", "name": "to reconstruct"})
        cards.append({"value": f"{max(s['peak_mb'] for s in stages) / 1000:.1f} GB", "name": "peak memory"})
    for s in sections:
        value = "✓" if s.ok else "✗"
        cards.append({"value": value, "name": s.verb, "mark": "good" if s.ok else "bad"})
    return cards


def _warnings(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Source and text of each warning of the reconstruction; those of the verbs stand with their tables."""
    found = [("recording", w) for w in manifest.get("warnings", [])]
    for stage, frames, text in warnings_of(manifest.get("stages", [])):
        found.append((f"{stage}, frames {frames[0]} to {frames[1]}" if frames else stage, text))
    return found


def _scene(run: Path | None, twin: Twin, glb: str, replays: Replays | None = None) -> dict[str, Any]:
    """What the page's scripts draw."""
    replays = replays or Replays()
    return {
        "glb": glb,
        "told": scene_document(run, twin, replays.told),
        "three": three_js(),
        "layers": [(name, text, name in _SHOWN) for name, text in _LAYERS.items()],
        "robots": replays.robots,
        "earlier": replays.earlier,
    }


def _drawn(twin: Twin) -> dict[str, Any]:
    """All pictures of the twin, and each part's states by its id."""
    return {**_pictures(twin), "plots": {str(p.id): _plot(p) for p in twin.parts}}


def _pictures(twin: Twin) -> dict[str, Any]:
    """The twin from closed to open, and the scene with the camera path; drawn at the same time.

    Of a room, which no one view shows, each part from closed to open, and a map.
    """
    from twin.report.meshes import dollhouse, opening, plan

    nothing: dict[str, Any] = {"opening": [], "dollhouse": "", "plan": ""}
    if not len(twin.static.mesh.faces) and not any(len(p.mesh.faces) for p in twin.parts):
        return nothing
    steps = STEPS if twin.parts else 1
    draw: dict[str, Callable[[], Any]] = {"dollhouse": lambda: jpeg(dollhouse(twin))}
    if len(twin.parts) > 1 and timeline(twin):
        draw["plan"] = lambda: jpeg(plan(twin))
        for part in twin.parts:
            draw[f"opening {part.id}"] = partial(_jpegs, partial(opening, twin, steps, only=part))
    else:
        draw["opening"] = partial(_jpegs, partial(opening, twin, steps))
    return nothing | dict(zip(draw, each(lambda one: one(), draw.values()), strict=True))


def _glb(twin: Twin) -> dict[str, str]:
    if not any(len(o.mesh.faces) for o in twin.owners):
        return {"glb": ""}
    try:
        return {"glb": scene_glb(twin)}
    except SceneError:  # as of a range that is empty: its card tells, and the pictures show it closed
        return {"glb": ""}


def _jpegs(draw: Callable[[], list[Image]]) -> list[str]:
    return [jpeg(image) for image in draw()]


def _plot(part: Part) -> str:
    return uri(state_plot(part).encode(), "image/svg+xml") if len(part.motion.frames) else ""


def _part(part: Part, pictures: Mapping[str, Any]) -> dict[str, Any]:
    color = "#{:02x}{:02x}{:02x}".format(*part_color(part))
    return {
        "name": part.name,
        "kind": part.joint.kind,
        "verdict": part.verdict,
        "low": float(shown(part, part.joint.lower)),
        "high": float(shown(part, part.joint.upper)),
        "unit": unit(part),
        "numbers": numbers(part),
        "other": "slide" if part.joint.kind == "revolute" else "hinge",
        "suffix": "deg" if part.joint.kind == "revolute" else "mm",
        "sigma": None if part.joint.sigma is None else float(shown(part, part.joint.sigma.state)),
        "color": color,
        "plot": pictures["plots"].get(str(part.id), ""),
        "opening": pictures.get(f"opening {part.id}", []),
        "facts": part_facts(part),
    }


def _stages(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    stages = manifest.get("stages", [])
    longest = max((s["seconds"] for s in stages), default=0.0) or 1.0
    return [{**s, "share": 100.0 * s["seconds"] / longest} for s in stages]


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else ""
