"""Trials: the same trajectory in many perturbed worlds, and how often it succeeds."""
