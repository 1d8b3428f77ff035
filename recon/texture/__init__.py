"""Texture: photographs of the recording on the meshes."""
