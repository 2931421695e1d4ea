"""Proposes designs: the best values of parameters within bounds and limits."""
