"""Linear algebra: direct solvers behind one door, eigenproblems, one definite form of shapes."""
