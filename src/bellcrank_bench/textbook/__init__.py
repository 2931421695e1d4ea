"""Equations of textbook mechanisms, written by hand."""
