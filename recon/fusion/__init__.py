"""Fusion: TSDF meshes of the static scene and of each part."""
