"""Closed forms and converged series that the finite elements are measured against. NumPy and SciPy only."""
