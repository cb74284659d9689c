"""Closed forms that contact laws and small models are made of and measured against. NumPy and SciPy only."""
