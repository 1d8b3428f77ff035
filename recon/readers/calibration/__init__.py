"""Calibrating a device: two cameras, the pose between them and the depth's scale, by pictures of a board."""
