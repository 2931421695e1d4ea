"""What acts on a robot: forces, controllers and constraints, each as expressions; none knows a scene."""
