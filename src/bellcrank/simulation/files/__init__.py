"""Files of runs: saved, read, kept while a run is computed."""
