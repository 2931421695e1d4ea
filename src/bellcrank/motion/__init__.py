"""Motions: paths and their time laws, inverse kinematics, interpolation, CSV files."""
