"""Files: read under limits, written whole or not at all; CSV texts, and the data that comes with bellcrank."""
