"""Calibrating a device: its two cameras, the pose between them and the scale of its depth, from pictures of a
board."""
