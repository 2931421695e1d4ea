"""A run: its rows, what follows from them, and how far it can be trusted."""
