"""Articulation-aware motion clustering: a line or an arc for each track, tracks of one joint together."""
