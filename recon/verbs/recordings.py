"""The verbs about recordings themselves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Sized
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from twin.cli.console import Console, Outcome
from twin.errors import InputError
from twin.files.paths import require_writable
from twin.runs.loop import Loop
from twin.runs.stages import Progress

T = TypeVar("T")


def inspect(console: Console, recording: Path, **opening: Any) -> Outcome:
    """What is wrong with a recording; a finding is no failure. opening: of `recon.open_recording`."""
    from recon.readers import open_recording

    opened = open_recording(recording, **opening)
    with console.progress() as progress:
        progress("inspect", 0.0, "")
        from recon.inspection.inspect import inspect as inspection_of

        found = inspection_of(opened)
        progress("inspect", 1.0, "")
    tables = [found.table()] if found.findings else []
    count = len(found.findings)
    said = f"{count} finding{'s' * (count != 1)}" if count else "nothing found"
    notes = [
        found.outlook.text,
        f"{said} in {found.frames} of {found.of} frames; checked: {', '.join(found.checked)}",
        *(f"not known: {u.check} ({u.why})" for u in found.unknown),
    ]
    return Outcome(found.as_dict(), tables, notes, opened.warnings)


def convert(
    console: Console, recording: Path, out: Path, into: Literal["native", "tum"], **opening: Any
) -> Outcome:
    """A recording of any layout into a folder of ours. opening: of `recon.open_recording`."""
    require_writable(out)
    from recon.readers import open_recording

    opened = open_recording(recording, **opening)
    from recon.recording.write import write_recording

    with console.progress() as progress:
        written = write_recording(opened, out, into, _loop(progress, "convert"))
        progress("convert", 1.0, "")
    k = opened.intrinsics
    notes = [f"recording: {written.path} ({written.frames} frames of {k.width}x{k.height})"]
    data = {"recording": str(written.path), "layout": into, "frames": written.frames}
    return Outcome(data, notes=notes, warnings=written.warnings)


def calibrate(
    console: Console,
    pictures: Sequence[Path],
    infrared: Sequence[Path],
    depth: Sequence[Path],
    board: str,
    out: Path,
    known: Path | None,
    coefficients: Literal[5, 8] | None,
    **sizes: Any,
) -> Outcome:
    """A camera, or a colour and a depth camera, from pictures of a board. sizes: the board's if no file."""
    require_writable(out)
    from recon.readers.calibration.board import CalibrationBoard, Kind, read_board
    from recon.readers.calibration.calibrate import calibrate as calibration_of
    from recon.readers.calibration.calibrate import write_calibration
    from recon.readers.calibration.file import read_calibration

    told = {name: value for name, value in sizes.items() if value is not None}
    kind = next((k for k in get_args(Kind) if k == board), None)
    if kind is not None:
        missing = [f"--{n}" for n in ("columns", "rows", "square") if n not in told]
        if missing:
            raise InputError(
                f"a {board} of unknown size: no {', '.join(missing)}", "count its squares, measure one"
            )
        chosen = CalibrationBoard(kind, **told)
    elif told:
        raise InputError(f"{board} tells the board, and so do --{', --'.join(told)}", "give one of both")
    else:
        chosen = read_board(Path(board))
    with console.progress() as progress:
        found = calibration_of(
            pictures,
            chosen,
            depth=infrared,
            depth_maps=depth,
            known=None if known is None else read_calibration(known),
            coefficients=coefficients,
            progress=_loop(progress, "calibrate"),
        )
        progress("calibrate", 1.0, "")
    file, picture = write_calibration(found, out)
    return Outcome(
        {"calibration": str(file), "picture": str(picture), "reasons": list(found.reasons)},
        notes=[*found.lines, f"calibration: {file}", f"residuals: {picture}"],
        ok=not found.reasons,
        doubt="; ".join(found.reasons),
    )


def _loop(progress: Progress, verb: str) -> Loop:
    """Tells how far a verb's loops are."""

    def wrap(items: Iterable[T], what: str) -> Iterator[T]:
        total = len(items) if isinstance(items, Sized) else 0
        for k, item in enumerate(items):
            if total:
                progress(verb, k / total, what)
            yield item

    return wrap
