"""Motions from rows of numbers: files, missing derivatives, jumps, interpolation."""
