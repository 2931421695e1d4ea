"""Checks of robot files."""
