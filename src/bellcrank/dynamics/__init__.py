"""Equations of motion: a scene's expressions assembled, and compiled when first asked for."""
