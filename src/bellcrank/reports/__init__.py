"""Reports: one HTML page with the verdict of a run or a sizing, its replay, tables and pictures."""
