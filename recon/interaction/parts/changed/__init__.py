"""Parts from what changed: joints proposed by the surfaces that left, judged on every frame's depth."""
