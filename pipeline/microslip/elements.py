"""Shape functions and quadrature of wedges and pyramids, with numpy alone.

Wedges: polynomials of the triangle times those of the height. The pyramid needs rational functions to be linear (or
quadratic) on its triangles and bilinear (serendipity) on its base, so that it fits tetrahedra and bricks (Bedrosian,
Int. J. Numer. Meth. Eng. 35 (1992) 95). Reference cells: `topology.CELL_TYPES`.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
from scipy.special import roots_jacobi

from .data import Array
from .topology import CELL_TYPES

_WEDGES = {
    "wedge": [(i, j, k) for i, j, k in product(range(2), repeat=3) if i + j <= 1],
    "wedge15": [(i, j, k) for i, j, k in product(range(3), repeat=3) if i + j <= 2 - (k == 2)],
}
TYPES = (*_WEDGES, "pyramid", "pyramid13")
"""Cell types that are evaluated here."""

_TIP = 1e-12
"""Distance from the tip of the pyramid, where gradients depend on the direction, within which they are held."""


def shape_functions(cell_type: str, at: Array) -> tuple[Array, Array]:
    """N (q, k) and reference gradients (q, 3, k) at reference coordinates (q, 3), nodes in VTK's order."""
    values, slopes = _terms(cell_type, np.asarray(at, dtype=float))
    C = _coefficients(cell_type)
    return values @ C, slopes @ C


@cache
def rule(cell_type: str, least: bool = False) -> tuple[Array, Array]:
    """Points (q, 3) and weights (q,): 6 and 9 in wedges, 8 and 27 in pyramids.

    least: of a wedge of 6 nodes two on its axis, as CalculiX.
    """
    if least and cell_type == "wedge":
        heights = (1 + np.polynomial.legendre.leggauss(2)[0]) / 2
        return np.array([[1 / 3, 1 / 3, h] for h in heights]), np.full(2, 0.25)
    if cell_type in _WEDGES:
        triangle = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
        heights, share = np.polynomial.legendre.leggauss(2 if cell_type == "wedge" else 3)
        places = [[*p, (1 + h) / 2] for h in heights for p in triangle]
        return np.array(places), np.repeat(share / 2, 3) / 6
    n = 2 if cell_type == "pyramid" else 3
    t, v = roots_jacobi(n, 2, 0)  # the cross-section shrinks with the square of the height
    x, w = np.polynomial.legendre.leggauss(n)
    points, weights = [], []
    for (height, a), (p, b), (q, c) in product(zip(t, v, strict=True), *(zip(x, w, strict=True) for _ in range(2))):
        z = (1 + height) / 2
        points.append([0.5 + 0.5 * p * (1 - z), 0.5 + 0.5 * q * (1 - z), z])
        weights.append(a / 8 * b * c / 4)
    return np.array(points), np.array(weights)


@cache
def _coefficients(cell_type: str) -> Array:
    return np.linalg.inv(_terms(cell_type, CELL_TYPES[cell_type].reference)[0])


def _terms(cell_type: str, at: Array) -> tuple[Array, Array]:
    """Values (q, k) and gradients (q, 3, k) of the functions that span the element."""
    if cell_type not in _WEDGES:
        return _pyramid_terms(at, quadratic=cell_type == "pyramid13")
    e = np.array(_WEDGES[cell_type])
    values = np.prod(at[:, None, :] ** e, axis=2)
    slopes = np.zeros((len(at), 3, len(e)))
    for d in range(3):
        lower = np.maximum(e - np.eye(3, dtype=int)[d], 0)
        slopes[:, d] = e[:, d] * np.prod(at[:, None, :] ** lower, axis=2)
    return values, slopes


def _pyramid_terms(at: Array, quadratic: bool) -> tuple[Array, Array]:
    a, b, z = 2 * at[:, 0] - 1, 2 * at[:, 1] - 1, at[:, 2]
    s = np.maximum(1 - z, _TIP)
    one, none = np.ones_like(a), np.zeros_like(a)
    r = a * b / s
    flat = [(one, (none, none, none)), (a, (one, none, none)), (b, (none, one, none)), (z, (none, none, one))]
    terms = [*flat, (r, (b / s, a / s, r / s))]
    if quadratic:
        terms += [(a * a, (2 * a, none, none)), (b * b, (none, 2 * b, none)), (z * z, (none, none, 2 * z))]
        terms += [(a * b, (b, a, none)), (a * z, (z, none, a)), (b * z, (none, z, b))]
        terms += [(a * r, (2 * r, a * a / s, a * r / s)), (b * r, (b * b / s, 2 * r, b * r / s))]
    values = np.stack([v for v, _ in terms], axis=1)
    slopes = np.stack([np.stack(g, axis=1) for _, g in terms], axis=2)
    return values, slopes * np.array([2.0, 2.0, 1.0])[:, None]
