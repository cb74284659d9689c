"""Beams at rest and rotating: Euler-Bernoulli roots, Timoshenko and rotating beams by converged series.

Two independent ways lead to the rotating beam: a Galerkin solution with Legendre polynomials and the power series
of Wright, Smith, Thresher and Wang, Vibration modes of centrifugally stiffened beams, J. Appl. Mech. 49 (1982).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.optimize import brentq

from microslip.contact.identification import Section
from microslip.data import Array

# ends -> (function whose roots are beta L, scaled so that it stays bounded; the k-th is near (k - shift) pi)
_EULER: dict[str, tuple[Callable[[float], float], float]] = {
    "clamped-free": (lambda b: np.cos(b) + 1 / np.cosh(b), 0.5),
    "free-free": (lambda b: np.cos(b) - 1 / np.cosh(b), -0.5),
    "clamped-clamped": (lambda b: np.cos(b) - 1 / np.cosh(b), -0.5),
    "pinned-pinned": (np.sin, 0.0),
}


def euler_bernoulli(count: int, ends: str = "clamped-free") -> Array:
    """(count,) numbers (beta L)^2 = omega / sqrt(E I / (rho A L^4)) of a uniform slender beam, elastic ones only.

    Raises:
        ValueError: unknown ends.
    """
    if ends not in _EULER:
        raise ValueError(f"ends must be one of {', '.join(_EULER)}")
    function, shift = _EULER[ends]
    near = (np.arange(1, count + 1) - shift) * np.pi
    return np.array([brentq(function, b - 0.45, b + 0.45, xtol=1e-14, rtol=1e-15) for b in near]) ** 2


def _series(terms: int, power: int, points: Array) -> tuple[Array, Array, Array]:
    """Values and first two derivatives (each (p, terms)) of s^power P_j(2 s - 1) on 0..1, for power 0, 1 or 2.

    By the product rule: written out in powers of s the polynomials would cancel to nothing.
    """
    basis = [Legendre.basis(j, domain=[0, 1]) for j in range(terms)]
    P, dP, ddP = (np.column_stack([b.deriv(d)(points) for b in basis]) for d in range(3))
    front, slope = (points**power)[:, None], (power * points ** max(power - 1, 0))[:, None]
    bend = 2.0 if power == 2 else 0.0
    return front * P, slope * P + front * dP, bend * P + 2 * slope * dP + front * ddP


def timoshenko(section: Section, count: int, ends: str = "clamped-free", terms: int = 18) -> Array:
    """(count,) angular frequencies, rad/s, of bending with shear and rotary inertia (Legendre-Galerkin).

    Args:
        ends: ``clamped-free`` or ``free-free`` (its two rigid motions are left out).

    Raises:
        ValueError: unknown ends.
    """
    if ends not in ("clamped-free", "free-free"):
        raise ValueError("ends must be clamped-free or free-free")
    power = 1 if ends == "clamped-free" else 0
    x, weight = leggauss(2 * terms + 4)
    (N, dN, _), w = _series(terms, power, 0.5 * (x + 1)), 0.5 * weight * section.length
    dN = dN / section.length
    s = section

    def form(a: Array, b: Array) -> Array:
        return (a * w[:, None]).T @ b

    stiff = s.kappa * s.shear * s.area
    K = np.block([
        [stiff * form(dN, dN), -stiff * form(dN, N)],
        [-stiff * form(N, dN), s.young * s.inertia * form(dN, dN) + stiff * form(N, N)],
    ])  # fmt: skip
    M = scipy.linalg.block_diag(s.density * s.area * form(N, N), s.density * s.inertia * form(N, N))
    values = scipy.linalg.eigh(K, M, eigvals_only=True)
    values = values[2:] if ends == "free-free" else values
    return np.sqrt(values[:count])


def rotating_beam_eigenvalues(
    speed: float, count: int, hub: float = 0.0, motion: str = "flap", terms: int = 16
) -> Array:
    """(count,) squares of the frequencies of `rotating_beam`; negative where the beam has diverged."""
    x, weight = leggauss(2 * terms + 4)
    s, w = 0.5 * (x + 1), 0.5 * weight
    N, dN, ddN = _series(terms, 2, s)
    tension = 0.5 * ((1 + hub) ** 2 - (s + hub) ** 2)
    K = (ddN * w[:, None]).T @ ddN + speed**2 * (dN * (w * tension)[:, None]).T @ dN
    M = (N * w[:, None]).T @ N
    values = scipy.linalg.eigh(K, M, eigvals_only=True)[:count]
    return values - (speed**2 if motion == "lag" else 0.0)


def rotating_beam(speed: float, count: int, hub: float = 0.0, motion: str = "flap", terms: int = 16) -> Array:
    """(count,) dimensionless frequencies of a slender clamped beam that rotates (Legendre-Galerkin).

    E I w'''' - (T w')' = rho A omega^2 w with T = rho A Omega^2 ((R_h + L)^2 - (R_h + s)^2) / 2; in the plane of
    rotation (``lag``) the centrifugal force turns with the section and omega^2 falls by Omega^2.

    Args:
        speed: Omega over sqrt(E I / (rho A L^4)). hub: R_h / L; below -1 the beam points to the axis and buckles.
    """
    return np.sqrt(rotating_beam_eigenvalues(speed, count, hub, motion, terms))


def southwell(mode: int, hub: float = 0.0, terms: int = 16) -> float:
    """Southwell's coefficient B of omega^2 = omega_0^2 + B Omega^2 (flap), from the shape at rest.

    By Rayleigh's principle the frequency so found is too high in the first mode, and B the slope at Omega = 0.

    Args:
        mode: 1 for the lowest. hub: R_h / L.
    """
    x, weight = leggauss(2 * terms + 4)
    s, w = 0.5 * (x + 1), 0.5 * weight
    N, dN, ddN = _series(terms, 2, s)
    _, shapes = scipy.linalg.eigh((ddN * w[:, None]).T @ ddN, (N * w[:, None]).T @ N)
    slope = dN @ shapes[:, mode - 1]
    return float(w @ (0.5 * ((1 + hub) ** 2 - (s + hub) ** 2) * slope**2))


def rotating_beam_wright(speed: float, count: int, hub: float = 0.0, terms: int = 90) -> Array:
    """(count,) dimensionless flap frequencies by the power series of Wright et al. (1982); count up to 4 or so.

    Arguments as `rotating_beam`.
    """
    start = rotating_beam(speed, count + 1, hub)  # brackets only; the root is the series' own
    bounds = [0.5 * start[0], *(0.5 * (start[:-1] + start[1:]))]
    return np.array(
        [
            brentq(_wright_determinant, a, b, args=(speed, hub, terms), xtol=1e-12)
            for a, b in zip(bounds[:-1], bounds[1:], strict=True)
        ]
    )


def _wright_determinant(frequency: float, speed: float, hub: float, terms: int) -> float:
    """Bending moment and shear force at the tip of the two series that start with s^2 and s^3."""
    tip = []
    for first in (2, 3):
        c = np.zeros(terms + 4)
        c[first] = 1.0
        for k in range(terms):
            # s^k in  w'''' = Omega^2 (tau w')' + omega^2 w,  tau = (1 + 2 h)/2 - h s - s^2/2
            value = frequency**2 * c[k] + speed**2 * (
                0.5 * (1 + 2 * hub) * (k + 2) * (k + 1) * c[k + 2] - hub * (k + 1) ** 2 * c[k + 1]
                - 0.5 * k * (k + 1) * c[k]
            )  # fmt: skip
            c[k + 4] = value / ((k + 4) * (k + 3) * (k + 2) * (k + 1))
        w = Polynomial(c)
        tip.append((w.deriv(2)(1.0), w.deriv(3)(1.0)))
    return tip[0][0] * tip[1][1] - tip[0][1] * tip[1][0]


def beam_element(h: float) -> tuple[Array, Array]:
    """Stiffness and mass of a Hermite element of length h, E I and mass per length 1; (displacement, slope) twice."""
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
                  [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
    m = h / 420 * np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                            [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]])  # fmt: skip
    return k, m
