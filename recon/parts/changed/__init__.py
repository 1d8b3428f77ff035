"""Parts told by what changed: joints proposed by the shape of the surfaces that left, judged on every frame's
depth."""
