"""Compiled equations of motion against analytic ones: what `bellcrank verify` runs."""
