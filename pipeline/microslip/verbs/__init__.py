"""Analyses, a file each: keys, solution, answer, figures; see `microslip.analysis`."""
