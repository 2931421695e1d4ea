"""Postures that satisfy the constraints: starts, and the joints of a linkage that follow from others."""
