"""The limits of a motion along a path: joints, motors and gears, tools."""
