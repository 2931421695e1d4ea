"""Constraints: their derivatives, which rows are independent, mobility, reactions."""
