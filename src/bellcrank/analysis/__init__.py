"""Linear analysis: operating points, linearised equations, modes and root loci."""
