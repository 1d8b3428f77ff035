"""ROS 1 and ROS 2 bags and MCAP files, read without ROS, those of RealSense cameras included."""

from recon.readers.ros.reader import RosReader

__all__ = ["RosReader"]
