"""Dense data that several stages share: depth images and voxels."""
