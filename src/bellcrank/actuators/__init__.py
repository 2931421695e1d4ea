"""Actuators: a motor with its gear."""
