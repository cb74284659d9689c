"""Hertz' ellipses of many poses at once, and the two bodies as one (Sextro, 6.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..contact.hertz import axis_ratio, ellipse_integrals
from ..contact.solids import Solid, normal_modulus
from ..data import Array
from ..settings.arguments import checked, checked_fields
from ..settings.numbers import Positive
from .arguments import NotNegatives, Poisson, Positives, joined


@checked_fields
@dataclass(frozen=True)
class Elastic:
    """Both bodies as one. Attributes: modulus: E*, Pa. shear: G, Pa. poisson: nu."""

    modulus: Positive
    shear: Positive
    poisson: Poisson


def combined(first: Solid, second: Solid) -> Elastic:
    """1/G = (1/G1 + 1/G2)/2, nu/G = (nu1/G1 + nu2/G2)/2 (Kalker 1990, 1.44); E* of `contact.solids`.

    Raises:
        UserError: both are rigid.
    """
    modulus = normal_modulus(first, second)
    G = 2 / (1 / first.shear + 1 / second.shear)
    return Elastic(modulus, G, 0.5 * G * (first.poisson / first.shear + second.poisson / second.shear))


@cache
def _widths() -> tuple[Array, Array, Array]:
    """ln(low/high) of the half curvatures, and ln of (short axis)^2 and (long axis)^2 times low/approach."""
    log_ratio = np.linspace(-18.0, 0.0, 4001)
    g = axis_ratio(np.exp(log_ratio))
    K, D, _ = ellipse_integrals(g)
    return log_ratio, np.log(g**2 * D / K), np.log(D / K)


def half_width(A: float, B: ArrayLike, approach: float) -> Array:
    """b (m) of ellipses, to 1e-6 of it, a hundred times faster than `ellipses`; see there."""
    log_ratio, short, long = _widths()
    low, at = np.minimum(A, B), -np.abs(np.log(A / np.asarray(B)))
    of = np.where(np.less_equal(A, B), np.interp(at, log_ratio, short), np.interp(at, log_ratio, long))
    return np.sqrt(np.exp(of) * approach / low)


class Ellipse(NamedTuple):
    """Arrays (n,). Attributes: a, b: half axes along and across rolling, m. approach: m. pressure: largest, Pa."""

    a: Array
    b: Array
    approach: Array
    pressure: Array


@checked
def ellipses(A: Positives, B: Positives, force: NotNegatives, modulus: Positive) -> Ellipse:
    """Hertz' contact for any axis ratio, in both directions (Sextro Eqs. (6.4-9) to (6.4-17), (6.4-24)).

    Args:
        A, B: half relative curvatures along and across rolling, 1/m: the gap is A x^2 + B y^2. Either may be the larger
            one. force: N, not negative. modulus: E*, Pa.

    Raises:
        UserError: other numbers.
    """
    A, B, F = joined(A=A, B=B, force=force)
    low, high = np.minimum(A, B), np.maximum(A, B)
    g = axis_ratio(low / high)
    K, D, _ = ellipse_integrals(g)
    approach = (3 * F * K / (2 * np.pi * modulus) * np.sqrt(low * K / D)) ** (2 / 3)
    long = np.sqrt(approach * D / (low * K))
    a, b = np.where(A <= B, long, g * long), np.where(A <= B, g * long, long)
    area = np.pi * a * b
    return Ellipse(a, b, approach, np.divide(1.5 * F, area, out=np.zeros_like(area), where=area > 0))
