"""Faults planted into exported files, one at a time: what `twin lint` must find, and by which rule.

Also used by benchmarks/lint.py, which asks the public validators about the same files.
"""

from tests.twin.lint_mutations import files, joints, motion, quantities, shapes
from tests.twin.lint_mutations.planting import Mutation, lint_twin

__all__ = ["MUTATIONS", "Mutation", "lint_twin"]

MUTATIONS: list[Mutation] = [
    *quantities.MUTATIONS,
    *joints.MUTATIONS,
    *shapes.MUTATIONS,
    *files.MUTATIONS,
    *motion.MUTATIONS,
]
