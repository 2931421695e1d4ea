"""A scene for many values of its parameters, and what changes with them."""
