"""Twins written by hand, as their owners would: legal, illegal, and open ones, of which only silence is
wrong."""

from tests.makers.twin.hand_made import illegal, illegal_meshes, legal, legal_files, legal_shapes, open_
from tests.makers.twin.hand_made.cases import Case

__all__ = ["ILLEGAL", "LEGAL", "OPEN", "Case"]

LEGAL: list[Case] = [*legal.CASES, *legal_shapes.CASES, *legal_files.CASES]
ILLEGAL: list[Case] = [*illegal.CASES, *illegal_meshes.CASES]
OPEN: list[Case] = [*open_.CASES]
