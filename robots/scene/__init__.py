"""The simulated scene: a twin and a robot in one MuJoCo model."""
