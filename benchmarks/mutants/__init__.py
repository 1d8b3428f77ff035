"""Planted faults: which of them the default tests notice. `python -m benchmarks.mutants --help`."""
