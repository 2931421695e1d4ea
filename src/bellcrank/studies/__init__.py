"""Parameter studies: a scene simulated for many values of its parameters."""
