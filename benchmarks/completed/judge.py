"""One exported asset against its truth: every figure by name, None where it doesn't apply."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.completed.asset import STATIC, Asset, load_asset
from benchmarks.completed.balls import balls_kept, opens_far
from benchmarks.completed.handle import Bar, called_assumed, section, true_bar
from benchmarks.completed.sight import front_of, see_through
from benchmarks.completed.surfaces import (
    REAR_SHARE,
    SIDE_SHARE,
    both_faces_seen,
    covered,
    inferred_areas,
    is_closed,
    rear_share,
    seen_share,
    side_share,
)
from recon.evaluation.read_truth import load_truth
from recon.evaluation.scores import camera_errors, match_parts
from recon.evaluation.surface_scores import seen_points
from recon.evaluation.truth import Truth, TruthPart
from recon.readers import open_recording
from twin.collision.fit import fit_of
from twin.collision.solid import Solid
from twin.errors import InputError
from twin.files.ply import read_ply
from twin.files.text import read_json
from twin.geometry import Array
from twin.scene import STATIC_LABEL, Completion, Mesh, Part
from twin.storage import load


def judge(run: Path, truth_folder: Path) -> dict[str, Any]:
    """Measure the exported MJCF of a run against the simulator's truth; definitions: docs/metrics.md,
    "Completed assets".

    Args:
        run: run folder with twin/ and export/mjcf/.
        truth_folder: truth/ of a simulated recording; what the recording shows is asked where it lies around
            it.

    Returns:
        {"recording", "parts": [a dictionary for each true part], "static": of the furniture}, JSON types;
        None: doesn't apply.

    Raises:
        InputError: no export, no truth, or one of another recording.
    """
    twin, truth = load(run), _simulated(truth_folder)
    if twin.cameras is None:
        raise InputError(f"twin {twin.name} has no cameras", "give one that was reconstructed")
    T = camera_errors(twin.cameras, truth).T_truth_recon
    asset = load_asset(Path(run), twin, T)
    pairs = match_parts([(p.joint, p.motion) for p in twin.parts], T, truth)
    parts = []
    for i, known in enumerate(_known(truth)):
        out = known.told() | {"found": i in pairs, "carcass": known.carcass_covered(asset)}
        parts.append(out | _measured(asset, twin.parts[pairs[i]], known) if i in pairs else out)
    static = _layer(asset, STATIC, twin.static.completion, truth.static)
    return {"recording": _name(truth), "parts": parts, "static": static}


def missed(truth_folder: Path) -> dict[str, Any]:
    """What `judge` says where there is no asset at all: no part is found, no carcass covered. Raises
    InputError without a truth."""
    truth = _simulated(truth_folder)
    parts = [
        known.told() | {"found": False, "carcass": None if known.carcass is None else 0.0}
        for known in _known(truth)
    ]
    return {"recording": _name(truth), "parts": parts, "static": None}


def _name(truth: Truth) -> str:
    """Name of the recording around a truth; of the folder around that where it is just called a recording."""
    place = truth.folder.resolve().parent
    return place.parent.name if place.name == "recording" else place.name


def _simulated(folder: Path) -> Truth:
    truth = load_truth(folder)
    if truth.cameras is None or not truth.knows("cameras", "meshes", "static", "states"):
        raise InputError(
            f"{truth.folder} doesn't tell enough to judge an asset by",
            "give the truth of a simulated recording",
        )
    return truth


@dataclass(frozen=True, eq=False)
class _Known:
    """A true part with its furniture and handle, what stands still, the way its front looks, and what the
    recording shows of both."""

    true: TruthPart
    carcass: Mesh | None
    bar: Bar | None
    static: Mesh
    outward: Array
    seen: Array | None
    seen_static: Array | None

    def told(self) -> dict[str, Any]:
        """What doesn't depend on the asset."""
        side = None
        if self.carcass is not None and self.seen_static is not None:
            side = side_share(self.carcass, self.outward, self.seen_static) >= SIDE_SHARE
        told = {"part": self.true.name, "kind": self.true.joint.kind, "carcass side seen": side}
        told |= {"has handle": self.bar is not None, "is drawer": opens_far(self.true) is not None}
        return told | _shown(self.true, self.seen)

    def carcass_covered(self, asset: Asset) -> float | None:
        return None if self.carcass is None else covered(self.carcass, asset.visuals(STATIC))


def _known(truth: Truth) -> Iterator[_Known]:
    if truth.cameras is None:
        return
    place = truth.folder.parent
    seen = seen_points(open_recording(place), truth) if (place / "color").is_dir() else None
    grips = {int(p["id"]): p["grip"] for p in read_json(truth.folder / "truth.json")["parts"]}
    for true in truth.parts:
        path = truth.folder / f"furniture_{true.id}.ply"
        yield _Known(
            true,
            read_ply(path) if path.is_file() else None,
            true_bar(true, grips[true.id]),
            truth.static,
            front_of(true.closed_mesh, truth.cameras.T_world_cam),
            None if seen is None else seen.get(true.id, np.zeros((0, 3))),
            None if seen is None else seen.get(STATIC_LABEL, np.zeros((0, 3))),
        )


def _measured(asset: Asset, part: Part, known: _Known) -> dict[str, Any]:
    """All figures of a part that was found."""
    true, bar = known.true, known.bar
    visuals, colliders = asset.visuals(part.name), asset.colliders(part.name)
    out: dict[str, Any] = {"full": covered(true.closed_mesh, visuals)}
    out["full, seen layer"] = covered(true.closed_mesh, [g for g in visuals if g.inferred is None])
    out |= _layer(asset, part.name, part.completion, true.closed_mesh)
    fit = fit_of([g.mesh for g in colliders], Solid.of_mesh(true.closed_mesh))
    # without a shape nothing stands out, and nothing is there: 0 of the volume tells that
    out["outside p95, mm"] = 1e3 * fit.outside if np.isfinite(fit.outside) else None
    out["volume ratio"] = fit.ratio
    sight = see_through(asset, part.name, true, known.carcass, known.static, known.outward)
    out["sight"] = None if sight is None else asdict(sight)
    out["handle"] = None if bar is None else asdict(section(bar, true, visuals, colliders))
    out["handle assumed"] = None if bar is None else called_assumed(bar, visuals, part.completion)
    out["balls"] = balls_kept(asset, part.name, true)
    return out


def _shown(true: TruthPart, seen: Array | None) -> dict[str, Any]:
    """What the recording shows of a true part, points (n, 3); None where there is no recording."""
    if seen is None:
        return dict.fromkeys(("seen", "rear share", "rear seen", "both faces seen"))
    rear = rear_share(true, seen)
    return {
        "seen": seen_share(true.closed_mesh, seen),
        "rear share": rear,
        "rear seen": None if rear is None else rear >= REAR_SHARE,
        "both faces seen": both_faces_seen(true.closed_mesh, seen),
    }


def _layer(asset: Asset, owner: str, completion: Completion | None, true: Mesh) -> dict[str, Any]:
    """What was inferred of a body, and whether it and the colliders are closed."""
    visuals, colliders = asset.visuals(owner), asset.colliders(owner)
    pieces = [g for g in visuals if g.inferred is not None]
    return {
        "inferred": {basis: asdict(a) for basis, a in inferred_areas(visuals, completion, true).items()},
        "pieces": len(pieces),
        "open pieces": sorted(g.name for g in pieces if not is_closed(g.mesh)),
        "shapes": len(colliders),
        "open shapes": sorted(g.name for g in colliders if not is_closed(g.mesh)),
    }
