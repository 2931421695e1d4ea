"""Inverse kinematics along the path of a frame, and rotations."""
