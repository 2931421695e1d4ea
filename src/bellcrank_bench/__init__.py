"""Results against independent routes: textbook equations, Pinocchio's own, other compilers."""
