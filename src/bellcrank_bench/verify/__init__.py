"""Compiled dynamics against textbook equations."""
