"""Grasps: where and how the gripper holds a part, and the path of the tool from it."""
