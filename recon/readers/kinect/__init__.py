"""Azure Kinect recordings, read without an SDK."""

from recon.readers.kinect.reader import AzureKinectReader

__all__ = ["AzureKinectReader"]
