"""YAML files: line numbers, units and checked fields."""
