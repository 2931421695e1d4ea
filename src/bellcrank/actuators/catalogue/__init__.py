"""Catalogues of motors and gears: their files, columns and checks."""
