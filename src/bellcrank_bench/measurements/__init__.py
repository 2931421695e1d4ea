"""Measurements: what is timed or varied, and the numbers that come out; `tables` and `plots` show them."""
