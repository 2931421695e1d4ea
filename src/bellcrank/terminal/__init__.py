"""The terminal: printable text, progress bars, standard streams and signals."""
