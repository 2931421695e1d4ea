"""The reference problems: scenes with known answers."""
