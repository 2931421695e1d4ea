"""Motions made from a description: waypoints, paths of frames, moves from posture to posture."""
