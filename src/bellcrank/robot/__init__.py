"""A robot: its tree as plain data, what it carries, and its dynamics as machine code."""
