"""Results before the eyes: tables as text, CSV and JSON, and the style of plots."""
