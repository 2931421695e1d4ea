"""Readers of robot files: each format becomes one record, `RobotFile`."""
