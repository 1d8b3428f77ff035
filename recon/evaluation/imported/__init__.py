"""Truth that others annotated, read from their files when asked; nothing is written, no pickle is opened."""

from __future__ import annotations

from pathlib import Path

from recon.evaluation.imported import arti4d_truth, hoi4d_truth
from recon.evaluation.truth import Truth
from recon.readers.itaco import ItacoReader
from twin.errors import InputError


def imported_truth(folder: Path) -> Truth | None:
    """The truth of an annotated clip of HOI4D or Arti4D; None for another folder.

    Raises InputError for such a clip without annotations, and for one of iTACO, whose truth is pickled.
    """
    if not folder.is_dir():
        return None
    if hoi4d_truth.recognises(folder):
        return hoi4d_truth.hoi4d_truth(folder)
    if arti4d_truth.recognises(folder):
        return arti4d_truth.arti4d_truth(folder)
    if ItacoReader().recognises(folder):
        raise InputError(
            f"{folder} is a view of iTACO, whose truth (actor_pose.pkl) is pickled, which can run code: it is not read",
            "write the joint into a truth/truth.json",
        )
    return None
