"""Equilibrium at speed, eigenmodes, static answers, strain and stress modes, interface rows."""
