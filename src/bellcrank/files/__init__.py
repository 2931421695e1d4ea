"""Files: reading with limits, atomic writing, CSV, temporary files, and the data bundled with bellcrank."""
