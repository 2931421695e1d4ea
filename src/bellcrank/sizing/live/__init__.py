"""Sizings of pages that compute: what their reader changes, as expressions."""
