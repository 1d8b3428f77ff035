"""Robot models: their description, files, kinematics and dynamics."""
