"""Stability of an equilibrium or of steady sliding: the roots of (s^2 M + s C + K) x = 0, all of them in a window."""
