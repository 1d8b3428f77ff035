"""Faults planted into exported files, one at a time: what `twin lint` must find, and by which rule.

tests/twin/lint/test_lint.py asks our own rules; benchmarks/lint.py asks the public validators about the same
files.
"""

from benchmarks.lint_faults import files, joints, motion, quantities, shapes, sizes
from benchmarks.lint_faults.planting import Mutation, lint_twin

__all__ = ["MUTATIONS", "Mutation", "lint_twin"]

MUTATIONS: list[Mutation] = [
    *quantities.MUTATIONS,
    *joints.MUTATIONS,
    *shapes.MUTATIONS,
    *sizes.MUTATIONS,
    *files.MUTATIONS,
    *motion.MUTATIONS,
]
