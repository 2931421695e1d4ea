"""The designs of a study: axes, their values, and what an ensemble takes of them."""
