"""What a replay shows: poses, arrows, series and cameras, as plain data."""
