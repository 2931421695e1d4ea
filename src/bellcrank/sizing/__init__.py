"""Sizing: loads along motions, their peaks, drives, verdicts, and the reports of them."""
