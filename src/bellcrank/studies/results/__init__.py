"""Results of studies: measures, tables, files, pictures, statistics."""
