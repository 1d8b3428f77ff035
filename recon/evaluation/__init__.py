"""Evaluation: a twin compared with the truth of its recording."""
