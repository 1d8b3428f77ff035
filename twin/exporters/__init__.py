"""Export of twins to simulation formats: one intermediate tree, one writer per format that only reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from twin.completion.asset import AssetView, is_reconstructed, usual_view
from twin.contacts import contacts_off
from twin.errors import InputError
from twin.exporters.asset import AssetInfo
from twin.exporters.footage import Footage as Footage
from twin.exporters.notes import readme
from twin.exporters.package import check_package, write_package
from twin.exporters.tree import Tree, build_tree, require_ranges
from twin.files.atomic import staging
from twin.files.own_files import hashes, refuse_edited, replace_own
from twin.files.paths import AnyPath
from twin.level import level_evidence
from twin.names import several
from twin.runs.progress import shows_bar
from twin.scene import Twin
from twin.soundness import overlaps, require_sound

if TYPE_CHECKING:
    from twin.collision.meetings import Meeting

Format = Literal["urdf", "mjcf", "usd", "glb", "rrd"]
ALL_FORMATS: tuple[Format, ...] = get_args(Format)
# what is simulated; glTF and Rerun are only looked at
FORMATS: tuple[Format, ...] = ALL_FORMATS[:3]


@dataclass(frozen=True)
class Exported(Mapping[str, Path]):
    """Format -> main file, with a warning for everything a format can't carry.

    overlaps: bodies with collision shapes over 2 mm deep in others when closed; an engine throws them apart.
    """

    files: Mapping[str, Path]
    warnings: tuple[str, ...] = ()
    overlaps: tuple[Meeting, ...] = ()

    def __getitem__(self, fmt: str) -> Path:
        return self.files[fmt]

    def __iter__(self) -> Iterator[str]:
        return iter(self.files)

    def __len__(self) -> int:
        return len(self.files)


@shows_bar("export")
def export(
    twin: Twin,
    folder: AnyPath,
    formats: str | Sequence[str] = FORMATS,
    package: str = "",
    cache_dir: AnyPath | None = None,
    asset: AssetInfo | None = None,
    overwrite: bool = False,
    view: AssetView | None = None,
    collision: Mapping[str, Any] | None = None,
    footage: Footage | None = None,
) -> Exported:
    """Write `formats`: folder/urdf/<name>.urdf, mjcf/<name>.xml, scene.xml, usd/<name>.usda; glb/<name>.glb,
    rrd/<name>.rrd.

    Each format's folder is complete in itself, with notes on importing it (README.md) and a list of what was
    exported (files.json). All are written before the first is changed; files of others stay.

    Args:
        package: makes folder/urdf a ROS package of this name, with a second URDF of package:// paths.
        cache_dir: where collision shapes are kept between runs.
        asset: author, licence, kind and date, as files state.
        overwrite: also replace exported files that were changed since, and others of the same names.
        view: layer, room and frame; `twin.completion.asset.usual_view` by default.
        collision: settings of collision shapes, by name: {"part_pieces": 8}.
        footage: what rrd shows beside the twin.

    Returns:
        Each format's main file, warnings about what a format can't carry, and overlaps to be mended.

    Raises:
        InputError: unknown format, illegal package name, an unwritable folder, a changed file.
        SceneError: a part that can't be simulated.
        MissingDependencyError: rrd without rerun-sdk.
    """
    folder, formats = Path(folder), _asked(formats, package)
    asset, view = asset or AssetInfo(), view or usual_view(twin)
    ready = _shown(twin, view, cache_dir, collision)
    tree, met = build_tree(ready), _meetings(twin, ready)
    trees, lost_shapes = _trees(ready, tree, formats, met)
    files: dict[str, Path] = {}
    warnings = [*_warnings(twin, ready, tree, met), *lost_shapes]
    try:
        with ExitStack() as stack:
            staged = {fmt: stack.enter_context(staging((folder / fmt).resolve())) for fmt in formats}
            for fmt, here in staged.items():
                path, lost = _written(fmt, trees[fmt], here, asset, ready, footage)
                (here / "README.md").write_text(readme(trees[fmt], fmt), encoding="utf-8", newline="\n")
                view.write(twin, here)
                files[fmt] = folder / fmt / path.name
                warnings += lost
            if package and "urdf" in files:
                write_package(staged["urdf"], files["urdf"].name, package, asset)
            _put(staged, folder, overwrite)
    except OSError as e:
        raise InputError(
            f"{folder} can't be written: {e.strerror or e}", "check space and permissions"
        ) from e
    return Exported(files, tuple(warnings), tuple(m for m in met if m.rests))


def _asked(formats: str | Sequence[str], package: str) -> list[str]:
    """The formats, which are known; a package's name is checked as well."""
    asked = list(several(formats))
    unknown = [f for f in asked if f not in ALL_FORMATS]
    if unknown:
        raise InputError(f"format {unknown[0]!r} is not known", f"choose from {', '.join(ALL_FORMATS)}")
    if package:
        check_package(package)
    return asked


def _written(
    fmt: str, tree: Tree, folder: Path, asset: AssetInfo, twin: Twin, footage: Footage | None
) -> tuple[Path, list[str]]:
    """The main file of a format, written, and what it can't carry."""
    writer = import_module(f"twin.exporters.{fmt}")
    path, lost = (
        writer.write(tree, folder, twin, footage) if fmt == "rrd" else writer.write(tree, folder, asset)
    )
    return path, lost


def _shown(
    twin: Twin, view: AssetView, cache_dir: AnyPath | None, collision: Mapping[str, Any] | None
) -> Twin:
    """The twin as it is written."""
    ready = complete(view.of(complete(twin, cache_dir, view, collision)), cache_dir, view, collision)
    if not (view.plain and is_reconstructed(twin)):
        return ready
    from twin.physics import without_rests

    return without_rests(ready)  # as it was before rests were looked at, to the byte


def _meetings(twin: Twin, ready: Twin) -> list[Meeting]:
    """The bodies of a completed twin (`ready`) whose shapes overlap or touch while a part opens."""
    from twin.collision.meetings import meetings, shapes_of  # SciPy, which a wrong option needs not wait for

    return meetings(ready, {owner.name for owner in twin.owners if not shapes_of(owner)}, touching=True)


def _trees(
    ready: Twin, tree: Tree, formats: Sequence[str], met: Sequence[Meeting]
) -> tuple[dict[str, Tree], list[str]]:
    """The tree of each format, and a line for each body cut in URDF, which can't filter pairs."""
    from twin.collision.meetings import meetings, with_pairs_cut

    cut, told = with_pairs_cut(ready, met) if "urdf" in formats else (ready, [])
    own = tree if cut is ready else build_tree(cut)
    left = {m.names: m.depth for m in (met if cut is ready else meetings(cut)) if m.overlaps}
    return {fmt: replace(own, meeting=left) if fmt == "urdf" else tree for fmt in formats}, [
        f"urdf: {text}" for text in told
    ]


def _warnings(twin: Twin, ready: Twin, tree: Tree, met: Sequence[Meeting]) -> list[str]:
    """What of a completed twin (`ready`) is not as one would wish."""
    from twin.physics import unheld

    bare = [k.name for k in tree.links if not k.collision]
    found = [f"{name} has no collision shapes, so nothing can touch it" for name in bare]
    found += [*overlaps(ready), *(m.text for m in met if m.overlaps and not m.filtered)]
    found += [f"{off.problem}; {off.remedy}" for off in contacts_off(twin)]
    found += unheld(ready)
    level = level_evidence(ready)
    found += [level.text] if level.contradicted else []
    if not tree.moving:
        found.append("the twin has no moving part, so nothing in its files opens")
    return [f"all: {text}" for text in found]


def _put(staged: Mapping[str, Path], folder: Path, overwrite: bool) -> None:
    """Exchange the folder of every format, none unless all may be."""
    if not overwrite:
        for fmt, here in staged.items():
            refuse_edited(folder / fmt, hashes(here))
    for fmt, here in staged.items():
        replace_own(here, folder / fmt, overwrite)


def complete(
    twin: Twin,
    cache_dir: AnyPath | None = None,
    view: AssetView | None = None,
    collision: Mapping[str, Any] | None = None,
) -> Twin:
    """The twin with mass, friction and collision shapes wherever they were missing, joints that hold its
    parts where they rested, and the inferred layer that a view asks for, by default that of `usual_view`.
    collision: settings of the shapes that are made, by name.

    Raises SceneError for an empty or unmovable part, and for a stated shape that is not convex.
    """
    from twin.collision.stated import require_convex

    require_sound(twin)
    require_convex(twin)
    require_ranges(twin)
    if any(p.inertial is None or p.physics is None for p in twin.parts):
        from twin.physics import with_physics

        twin = with_physics(twin)
    from twin.physics import with_rests

    twin = with_rests(twin)
    view = usual_view(twin) if view is None else view
    if view.geometry != "seen":
        from twin.completion import with_completion

        twin = with_completion(twin, collision)
    layers = [
        (twin.static.completion, twin.static.collision),
        *((p.completion, p.collision) for p in twin.parts),
    ]
    if any(layer is None and not shapes for layer, shapes in layers):
        from twin.collision import collision_config, with_collision

        twin = with_collision(twin, collision_config(collision), cache_dir)
    return twin
