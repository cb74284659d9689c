"""Closed forms and converged series of bodies that the tests measure the package against. NumPy and SciPy only."""
