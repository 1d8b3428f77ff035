"""The part-pose graph: axis and states from relative poses of the part between frames."""
