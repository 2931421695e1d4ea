"""Designs together with motors and gears of a catalogue."""
