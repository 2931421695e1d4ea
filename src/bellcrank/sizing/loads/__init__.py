"""What each axis bears along a motion: torques, peaks, root mean squares."""
