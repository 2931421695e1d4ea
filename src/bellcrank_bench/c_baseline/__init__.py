"""Scenes written by hand in C."""
