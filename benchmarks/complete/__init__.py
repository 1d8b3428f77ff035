"""Completed assets against the simulator's truth: how whole they are, and whether they hold, stop and show what the furniture does."""

from benchmarks.complete.judge import judge as judge
