"""Scenes: a robot configuration with forces, control, a start, parameters, events, outputs and solver settings."""
