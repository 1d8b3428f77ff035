"""Interactions merged: one part of several interactions, its states over the whole recording."""
