"""Integrate a scene's equations of motion, and the run that comes out of it."""
