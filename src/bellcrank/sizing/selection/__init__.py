"""Selection of motors and gears: the best pair of a catalogue for every axis of a mechanism."""
