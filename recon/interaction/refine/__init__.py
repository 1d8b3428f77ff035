"""Refinement: joints and states again, with every labelled pixel of a part (surfel bundle adjustment)."""
