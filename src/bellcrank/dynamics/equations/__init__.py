"""The equations of motion of a scene: assembled, solved, compiled."""
