"""Runs: stages that are computed once, their settings, their cache, and the lock of a run folder."""
