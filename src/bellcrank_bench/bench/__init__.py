"""Measurements of time and error."""
