"""Scenes: a robot card with forces, control, a start, parameters, events, outputs and solver settings."""
