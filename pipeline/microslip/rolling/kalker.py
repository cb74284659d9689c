"""Kalker's creep coefficients C11, C22, C23 and C33 of an elliptic contact that does not slip.

F_x = -c^2 G C11 xi, F_y = -c^2 G C22 eta - c^3 G C23 phi, M_z = c^3 G C23 eta - c^4 G C33 phi on the upper body, with
c = sqrt(a b) and a along rolling (Kalker, Three-dimensional elastic bodies in rolling contact, 1990; Sextro
Eq. (6.4-25) with the minus of the errata).
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..contact.law import Array
from ..programs import inner
from ..settings.arguments import checked
from .arguments import Poissons, Positives, joined

Coefficients = Literal["table", "book"]

# A row: each coefficient with nu = 0, 1/4, 1/2. C11, C22, C23: Kalker's table E.3, three digits. C33: computed here
# (tests/closed_forms/no_slip.py: the half-space in rectangles, extrapolated to the element size zero), which gives the
# other three to 0.7 % as well.
_NARROW = """
2.51 3.31 4.85  2.51 2.52 2.53  0.334 0.473 0.731  6.459 8.339 11.77
2.59 3.37 4.81  2.59 2.63 2.66  0.483 0.603 0.809  3.472 4.301 5.709
2.68 3.44 4.80  2.68 2.75 2.81  0.607 0.715 0.889  2.5   2.978 3.75
2.78 3.53 4.82  2.78 2.88 2.98  0.720 0.823 0.977  2.023 2.326 2.798
2.88 3.62 4.83  2.88 3.01 3.14  0.827 0.929 1.07   1.742 1.94  2.241
2.98 3.72 4.91  2.98 3.14 3.31  0.930 1.03  1.18   1.558 1.686 1.876
3.09 3.81 4.97  3.09 3.28 3.48  1.03  1.14  1.29   1.428 1.505 1.62
3.19 3.91 5.05  3.19 3.41 3.65  1.13  1.25  1.40   1.332 1.371 1.43
3.29 4.01 5.12  3.29 3.54 3.82  1.23  1.36  1.51   1.258 1.267 1.284
3.40 4.12 5.20  3.40 3.67 3.98  1.33  1.47  1.63   1.2   1.184 1.168
"""
_LONG = """
3.51 4.22 5.30  3.51 3.81 4.16  1.44  1.59  1.77   1.148 1.11  1.065
3.65 4.36 5.42  3.65 3.99 4.39  1.58  1.75  1.94   1.096 1.036 0.9617
3.82 4.54 5.58  3.82 4.21 4.67  1.76  1.95  2.18   1.046 0.9629 0.8593
4.06 4.78 5.80  4.06 4.50 5.04  2.01  2.23  2.50   0.9966 0.8898 0.7575
4.37 5.10 6.11  4.37 4.90 5.56  2.35  2.62  2.96   0.9485 0.8171 0.6559
4.84 5.57 6.57  4.84 5.48 6.31  2.88  3.24  3.70   0.9022 0.7447 0.5542
5.57 6.34 7.34  5.57 6.40 7.51  3.79  4.32  5.01   0.8583 0.6723 0.4517
6.96 7.78 8.82  6.96 8.14 9.79  5.72  6.63  7.89   0.8179 0.5995 0.3465
10.7 11.7 12.9  10.7 12.8 16.0  12.2  14.6  18.0   0.7829 0.5239 0.2331
"""
_ROWS = np.array((_NARROW + _LONG).split(), dtype=float).reshape(19, 4, 3)
_AT = 0.1 * np.arange(1, 20)
"""a/b up to 1, 2 - b/a beyond: between rows what is tabulated is straight over either."""

_POWERS = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.5, 0.0]])
"""Of g, the smaller of a/b and b/a, by which C11, C22, C23, C33 are multiplied to be nearly straight: a < b, a > b."""

LEAST = 0.1
"""g below which Kalker's asymptotes are used."""


@checked
def creep_coefficients(ratio: Positives, poisson: Poissons, source: Coefficients = "table") -> Array:
    """(4, ...) C11, C22, C23, C33.

    Between the rows of the table C g^n is straight over g and 1/C a parabola over Poisson's ratio: at most 1.3 % off
    half way between the first two rows, where straight lines of C itself are 17 % off. The book's polynomials (6.4-26)
    are for nu = 0.3 and 0.1 < a/b < 10, and have no C23 and C33: these come from the table.

    Args:
        ratio: a/b, a along rolling. poisson: nu of both bodies combined (`combined`), 0 to 0.5.

    Raises:
        UserError: a ratio that is not positive, another Poisson's ratio, another source.
    """
    return coefficients_at(*joined(ratio=ratio, poisson=poisson), source)


@partial(inner, static_argnames="source")
def coefficients_at(ratio: ArrayLike, poisson: ArrayLike, source: Coefficients = "table") -> Array:
    """`creep_coefficients` as a pure function of jax."""
    s, nu = jnp.broadcast_arrays(jnp.asarray(ratio, dtype=float), jnp.asarray(poisson, dtype=float))
    g = jnp.minimum(s, 1 / s)
    coefficients = jnp.where(g < LEAST, _asymptotes(s, nu), _between(s, jnp.maximum(g, LEAST), nu))
    if source == "book":
        c11 = 3.442 + 0.8980 * s + 0.01205 * s**2 - 0.00169 * s**3
        coefficients = jnp.stack([c11, 2.386 + 1.3578 * s - 0.02538 * s**2, coefficients[2], coefficients[3]])
    return coefficients


def _between(s: Array, g: Array, nu: Array) -> Array:
    powers: Array = jnp.where(s[..., None] <= 1, _POWERS[0], _POWERS[1])
    at = jnp.where(s <= 1, g, 2 - g)
    i = jnp.clip(jnp.searchsorted(jnp.asarray(_AT), at, side="right") - 1, 0, 17)
    share = (at - _AT[0] - 0.1 * i) / 0.1
    rows, size = jnp.asarray(_ROWS), jnp.asarray(np.minimum(_AT, 2 - _AT))
    ends = [rows[j] * (size[j][..., None] ** powers)[..., None] for j in (i, i + 1)]
    share, x = share[..., None, None], nu[..., None]
    columns = 1 / (ends[0] + share * (ends[1] - ends[0]))
    low, middle, high = (columns[..., k] for k in range(3))
    inverse = low * (1 - 2 * x) * (1 - 4 * x) + middle * 8 * x * (1 - 2 * x) + high * 2 * x * (4 * x - 1)
    return jnp.moveaxis(1 / (inverse * g[..., None] ** powers), -1, 0)


def _asymptotes(s: Array, nu: Array) -> Array:
    """Of very narrow and very long contacts (Kalker 1990, table E.3, below)."""
    g = jnp.minimum(s, 1 / s)
    narrow = jnp.stack([
        jnp.pi**2 / (4 * (1 - nu)), jnp.full_like(g, jnp.pi**2 / 4),
        jnp.pi * jnp.sqrt(g) / (3 * (1 - nu)) * (1 + nu * (jnp.log(16 / g) - 5)), jnp.pi**2 / (16 * (1 - nu) * g),
    ])  # fmt: skip
    L, rest = jnp.log(16 / g**2), 3 - np.log(4)
    N, M = (1 - nu) * L + 2 * nu, (1 - nu) * L - 2 + 4 * nu
    long = jnp.stack([
        2 * jnp.pi / ((L - 2 * nu) * g) * (1 + rest / (L - 2 * nu)), 2 * jnp.pi / (g * N) * (1 + (1 - nu) * rest / N),
        2 * jnp.pi / (3 * g**1.5 * M), jnp.pi / 4 * (1 - nu * (L - 2) / M),
    ])  # fmt: skip
    return jnp.where(s <= 1, narrow, long)
