"""Tracks: image corners followed through the recording and lifted to 3D by depth."""
