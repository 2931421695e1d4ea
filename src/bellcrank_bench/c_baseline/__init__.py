"""The C baseline: scenes and integrators written by hand in C, compiled for this processor when they are measured."""
