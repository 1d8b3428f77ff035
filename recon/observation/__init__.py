"""What pictures say: depth and colour of a pixel against surfaces, and what the static scene says there."""
