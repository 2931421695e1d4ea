"""Derivatives of a run by parameters and by its start."""
