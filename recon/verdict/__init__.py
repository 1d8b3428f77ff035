"""Judging what was found: by numbers that tell right from wrong without the truth."""
