"""Roots of (s^2 M + s C + K) x = 0 about an equilibrium or steady sliding: all in a window, over a range of speeds."""
