"""Elements that act on a robot: forces, controllers and constraints, written as expressions, independent of scenes."""
