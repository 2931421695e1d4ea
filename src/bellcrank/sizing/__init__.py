"""Sizing: loads along motions, their peaks, actuators, verdicts, and the reports of them."""
