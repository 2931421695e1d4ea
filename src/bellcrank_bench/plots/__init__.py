"""Measurements as PNG plots."""
