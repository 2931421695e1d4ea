"""Shapes of robots: mesh files, triangles, boxes."""
