"""Measurements as tables: text for the terminal, and Markdown for the README."""
