"""Rerun recording (.rrd): the twin's links as they move, the camera, what it saw, and tracks.

Entities: `world/<root>/<part>` with its transform over `time` (s from the first camera) and `frame`, meshes
below; `world/camera` with the recording's pictures, labels and tracks; `states/<part>`, in degrees or mm.
Needs rerun-sdk (extra `rerun`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin import geometry as geo
from twin.errors import MissingDependencyError
from twin.exporters.footage import Footage
from twin.exporters.links import Link, Tree, Visual
from twin.exporters.texture import photo_atlas
from twin.exporters.tree import started
from twin.files.text import read_json
from twin.mesh import GREY
from twin.packages import to_install
from twin.report.film import film_pictures_of
from twin.report.frames import HAND_COLOR, part_color
from twin.report.plots import shown, unit
from twin.scene import HAND_LABEL, Twin

_AXIS_M, _AXIS_RADIUS = 0.15, 0.004  # m, of the joint's arrow
_AXIS_COLOR, _TRACK_COLOR = (226, 30, 90), (255, 255, 255)
_TRACK_PX = -2.0  # radius; negative ones are of the screen


def write(tree: Tree, folder: Path, twin: Twin, footage: Footage | None) -> tuple[Path, list[str]]:
    """Write `<name>.rrd` into `folder`; returns the path and what is not carried. tree, twin: in one world.

    Raises MissingDependencyError without rerun-sdk.
    """
    try:
        import rerun as rr
    except ImportError as e:
        raise MissingDependencyError("format rrd needs rerun-sdk", to_install("rerun-sdk", "rerun")) from e
    path = folder / f"{tree.name}.rrd"
    recording = rr.RecordingStream("funtwin", recording_id=tree.name, send_properties=False)
    recording.set_log_time_enabled(False)  # nobody's clock but the recording's
    recording.set_log_tick_enabled(False)
    recording.save(path)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for link in tree.links:
        _log_link(recording, tree, link)
    frames_at = _camera(recording, twin)
    lost = _pictures(recording, twin, None if footage is None else footage.run, frames_at)
    tracks = {} if footage is None else footage.tracks
    for frame in sorted(set(tracks) & set(frames_at)):
        recording.set_time("time", duration=frames_at[frame])
        recording.set_time("frame", sequence=frame)
        recording.log("world/camera/tracks", rr.Points3D(tracks[frame], radii=_TRACK_PX, colors=_TRACK_COLOR))
    _states(recording, twin)
    recording.flush()
    recording.disconnect()
    return path, [
        "rrd: masses, friction and collision shapes are not carried (it shows, it does not simulate)",
        *lost,
    ]


def _entity(tree: Tree, link: Link) -> str:
    parents = {k.name: k for k in tree.links}
    above = "world" if link.parent is None else _entity(tree, parents[link.parent])
    return f"{above}/{link.name}"


def _log_link(recording: Any, tree: Tree, link: Link) -> None:
    import rerun as rr

    entity, joint = _entity(tree, link), link.joint
    for visual in link.visuals:
        if len(visual.mesh.faces):
            recording.log(f"{entity}/{visual.name}", _mesh(visual), static=True)
    if joint is None:
        return
    above = entity.rpartition("/")[0]
    arrow = rr.Arrows3D(
        vectors=[_AXIS_M * joint.axis],
        origins=[link.offset - 0.5 * _AXIS_M * joint.axis],
        radii=_AXIS_RADIUS,
        colors=_AXIS_COLOR,
    )
    recording.log(f"{above}/{joint.name}_axis", arrow, static=True)
    recording.log(entity, rr.Transform3D(translation=link.offset), static=not len(joint.times))
    if not len(joint.times):
        return
    turns = joint.kind == "revolute"
    moved = np.zeros((len(joint.states), 3)) if turns else joint.states[:, None] * joint.axis
    angle = joint.states if turns else np.zeros(len(joint.states))
    wxyz = geo.quat_wxyz_from_matrix(geo.exp_so3(angle[:, None] * joint.axis))
    columns = rr.Transform3D.columns(translation=link.offset + moved, quaternion=np.roll(wxyz, -1, axis=-1))
    recording.send_columns(entity, indexes=[rr.TimeColumn("time", duration=joint.times)], columns=columns)


def _mesh(visual: Visual) -> Any:
    import rerun as rr

    mesh = visual.mesh
    if mesh.texture is not None:
        baked = photo_atlas(mesh, np.arange(len(mesh.faces)))
        corners = mesh.vertices[mesh.faces[baked.order]].reshape(-1, 3)
        # v of Rerun goes down, as glTF's
        return rr.Mesh3D(
            vertex_positions=corners, triangle_indices=np.arange(len(corners)).reshape(-1, 3),
            vertex_texcoords=baked.uv * [1, -1] + [0, 1], albedo_texture=baked.image,
        )  # fmt: skip
    plain = (GREY,) * 3 if visual.color is None else tuple(round(255 * c) for c in visual.color)
    colors = mesh.colors if mesh.colors is not None and visual.color is None else None
    return rr.Mesh3D(
        vertex_positions=mesh.vertices, triangle_indices=mesh.faces, vertex_colors=colors,
        albedo_factor=None if colors is not None else plain,
    )  # fmt: skip


def _camera(recording: Any, twin: Twin) -> dict[int, float]:
    """The camera's way; returns s from the first one, by frame."""
    import rerun as rr

    if twin.cameras is None:
        return {}
    T, start = twin.cameras.T_world_cam, started(twin)
    xyzw = np.roll(geo.quat_wxyz_from_matrix(T[:, :3, :3]), -1, axis=-1)
    times = twin.cameras.times - start
    recording.send_columns(
        "world/camera",
        indexes=[rr.TimeColumn("time", duration=times), rr.TimeColumn("frame", sequence=twin.cameras.frames)],
        columns=rr.Transform3D.columns(translation=T[:, :3, 3], quaternion=xyzw),
    )
    recording.log("world/way", rr.LineStrips3D([T[:, :3, 3]]), static=True)
    return dict(zip(twin.cameras.frames.tolist(), times.tolist(), strict=True))


def _pictures(recording: Any, twin: Twin, run: Path | None, frames_at: Mapping[int, float]) -> list[str]:
    """The film of the run and its labels; what is not there."""
    import cv2
    import rerun as rr

    pictures = {} if run is None else film_pictures_of(run)
    lens = {} if run is None else read_json(run / "report" / "frames.json")
    kept = {frame: path for frame, path in pictures.items() if frame in frames_at}
    if not kept or "camera_matrix" not in lens:
        return ["rrd: the run keeps no film of its recording"]
    first = cv2.imread(str(next(iter(kept.values()))))
    assert first is not None
    height, width = first.shape[:2]
    of = read_json(run / "report" / "film" / "film.json").get("of", [width, height])  # type: ignore[operator]
    K = np.diag([width / of[0], height / of[1], 1.0]) @ np.array(lens["camera_matrix"])
    entity = "world/camera/image"
    recording.log(entity, rr.Pinhole(image_from_camera=K, width=width, height=height), static=True)
    colors = {**{p.id: (p.name, part_color(p)) for p in twin.parts}, HAND_LABEL: ("hand", HAND_COLOR)}
    context = rr.AnnotationContext([(k, name, color) for k, (name, color) in colors.items()])
    recording.log(f"{entity}/labels", context, static=True)
    for frame, path in sorted(kept.items()):
        recording.set_time("time", duration=frames_at[frame])
        recording.set_time("frame", sequence=frame)
        recording.log(entity, rr.EncodedImage(contents=path.read_bytes(), media_type="image/jpeg"))
        if frame in twin.labels:
            small = cv2.resize(twin.labels[frame], (width, height), interpolation=cv2.INTER_NEAREST)
            known = np.where(np.isin(small, list(colors)), small, 0).astype(np.uint8)
            recording.log(f"{entity}/labels", rr.SegmentationImage(known, opacity=0.5))
    return []


def _states(recording: Any, twin: Twin) -> None:
    import rerun as rr

    start = started(twin)
    for part in twin.parts:
        if len(part.motion.times):
            recording.log(
                f"states/{part.name}", rr.SeriesLines(names=[f"{part.name}, {unit(part)}"]), static=True
            )
            recording.send_columns(
                f"states/{part.name}",
                indexes=[rr.TimeColumn("time", duration=part.motion.times - start)],
                columns=rr.Scalars.columns(scalars=shown(part, part.motion.state)),
            )
