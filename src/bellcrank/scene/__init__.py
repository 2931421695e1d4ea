"""Scenes: a robot with constraints, forces, controllers, a start, parameters, events, outputs and solver settings."""
