"""Joints: type, axis, pivot and states of one joint from 3D tracks or part poses, with their uncertainty."""
