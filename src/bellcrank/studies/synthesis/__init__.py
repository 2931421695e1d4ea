"""Finds the links of a mechanism whose coupler passes given points."""
