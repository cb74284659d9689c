"""A whole ring from one cyclic sector: expansion, neighbours, what excites it."""
