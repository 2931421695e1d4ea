"""From a scene to the integrator and back: problems, settings, automatic gains, status."""
