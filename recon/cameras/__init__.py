"""Cameras: a pose for every frame from what does not move, in a world whose z axis points up."""
