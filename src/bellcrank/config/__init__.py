"""YAML with line numbers, units and checked fields."""
