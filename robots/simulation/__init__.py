"""Simulation: replay of a trajectory in MuJoCo, what it did, and what was wrong with it."""
