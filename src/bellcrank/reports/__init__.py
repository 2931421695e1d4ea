"""Reports: what was run or sized, the verdict first, with tables, pictures and the replay on one page."""
