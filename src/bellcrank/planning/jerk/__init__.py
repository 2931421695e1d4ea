"""The fastest motion with limits of jerk."""
