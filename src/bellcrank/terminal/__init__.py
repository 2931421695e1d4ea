"""The terminal: what may be printed on it, progress bars, and signals that ask to stop."""
