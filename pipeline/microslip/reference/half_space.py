"""Elastic half-space under a patch: how soft the neighbourhood of a contact is by itself."""

from __future__ import annotations

import numpy as np


def mean_inverse_distance(a: float, b: float) -> float:
    """Mean of 1/|x - y| (1/m) over all pairs of points of a rectangle with sides a and b (m).

    (2/(a b)^2) (a^2 b asinh(b/a) + a b^2 asinh(a/b) + (a^3 + b^3 - (a^2 + b^2)^(3/2))/3).
    """
    ends = (a**3 + b**3 - (a * a + b * b) ** 1.5) / 3
    return float(2 * (a * a * b * np.arcsinh(b / a) + a * b * b * np.arcsinh(a / b) + ends) / (a * b) ** 2)
