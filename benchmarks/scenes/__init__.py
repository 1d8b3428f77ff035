"""Closed-form scenes with exact truth, which tests and benchmarks share: tracks of moving parts, furniture,
twins, large meshes."""
