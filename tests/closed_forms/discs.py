"""Annular discs: plate waves at rest and at speed, the spinning membrane, centrifugal stress.

All waves are seen in the frame that turns with the disc, as exp(i (n theta + omega t)) with theta positive in the
direction of rotation: n > 0 with omega > 0 travels against the rotation (backward).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.polynomial import legendre
from scipy import special
from scipy.optimize import brentq

from microslip.data import Array


@dataclass(frozen=True)
class Disc:
    """A flat annular disc of uniform thickness.

    Attributes:
        inner, outer: radii, m. thickness: m. young: Pa. poisson. density: kg/m3. clamped: whether the bore is held;
        the rim is free.
    """

    inner: float
    outer: float
    thickness: float
    young: float
    poisson: float
    density: float
    clamped: bool = True

    @property
    def rigidity(self) -> float:
        """E h^3 / 12 (1 - nu^2), N m."""
        return self.young * self.thickness**3 / 12 / (1 - self.poisson**2)


# ---------------------------------------------------------------- thin plates: Bessel functions


def thin_plate_frequencies(disc: Disc, diameters: int, count: int) -> Array:
    """(count,) angular frequencies of Kirchhoff's plate, rad/s, elastic ones only.

    w = A J_n(kr) + B Y_n(kr) + C I_n(kr) + D K_n(kr), omega = k^2 sqrt(D / rho h); Leissa, Vibration of Plates
    (NASA SP-160, 1969), sections 1.1.2 and 2.2.

    Args:
        diameters: number n of nodal diameters.
    """
    step = 0.02 * np.pi / (disc.outer - disc.inner)
    roots: list[float] = []
    k, before = 1e-2 * step, 0.0
    while len(roots) < count:
        here = _determinant(disc, diameters, k)
        if before * here < 0:
            roots.append(brentq(lambda x: _determinant(disc, diameters, x), k - step, k, xtol=1e-14 * k, rtol=1e-14))
        k, before = k + step, here
    return np.array(roots) ** 2 * np.sqrt(disc.rigidity / disc.density / disc.thickness)


def _determinant(disc: Disc, n: int, k: float) -> float:
    inside = _held(disc, n, k, disc.inner) if disc.clamped else _free(disc, n, k, disc.inner)
    rows = np.vstack([inside, _free(disc, n, k, disc.outer)])
    rows /= np.abs(rows).max(axis=1)[:, None]
    return float(np.linalg.det(rows / np.abs(rows).max(axis=0)))


def _waves(disc: Disc, n: int, k: float, r: float) -> tuple[Array, Array]:
    """(4,) values and slopes of the four solutions at r, the exponential ones scaled to 1 at their larger end."""
    x, grow, fall = k * r, np.exp(k * (r - disc.outer)), np.exp(-k * (r - disc.inner))
    value = [special.jv(n, x), special.yv(n, x), special.ive(n, x) * grow, special.kve(n, x) * fall]
    grown = 0.5 * (special.ive(n - 1, x) + special.ive(n + 1, x))
    fallen = -0.5 * (special.kve(n - 1, x) + special.kve(n + 1, x))
    slope = [special.jvp(n, x), special.yvp(n, x), grown * grow, fallen * fall]
    return np.array(value), k * np.array(slope)


def _held(disc: Disc, n: int, k: float, r: float) -> Array:
    return np.array(_waves(disc, n, k, r))


def _free(disc: Disc, n: int, k: float, r: float) -> Array:
    """No bending moment, no shear with the twisting moment's slope (Kirchhoff)."""
    w, slope = _waves(disc, n, k, r)
    laplace = k**2 * np.array([-1, -1, 1, 1])
    nu = disc.poisson
    moment = laplace * w - (1 - nu) * (slope / r - n**2 * w / r**2)
    shear = laplace * slope - (1 - nu) * n**2 / r**2 * (slope - w / r)
    return np.array([moment, shear])


# ---------------------------------------------------------------- spinning discs


def centrifugal_stress(disc: Disc, speed: float) -> Callable[[Array], tuple[Array, Array]]:
    """r -> (sigma_r, sigma_theta), Pa, plane stress, of the disc at a speed (rad/s), rim free.

    Timoshenko and Goodier, Theory of Elasticity, section 32, with the bore free or held against radial motion.
    """
    nu, a, b = disc.poisson, disc.inner, disc.outer
    load = disc.density * speed**2 / 8

    def particular(r: Array) -> tuple[Array, Array]:
        return -(3 + nu) * load * r**2, -(1 + 3 * nu) * load * r**2

    radial, hoop = particular(np.array(a))
    if a == 0:  # whole disc: finite in the middle
        at_bore, value = np.array([0.0, 1.0]), np.zeros(())
    elif disc.clamped:  # E u / r = sigma_theta - nu sigma_r
        at_bore, value = np.array([1 - nu, -(1 + nu) / a**2]), nu * radial - hoop
    else:
        at_bore, value = np.array([1, 1 / a**2]), -radial
    right = np.array([value, -particular(np.array(b))[0]])
    A, B = np.linalg.solve(np.array([at_bore, [1, 1 / b**2]]), right)

    def stress(r: Array) -> tuple[Array, Array]:
        radial, hoop = particular(r)
        return A + B / r**2 + radial, A - B / r**2 + hoop

    return stress


def membrane_frequencies(poisson: float, diameters: int, speed: float, count: int) -> Array:
    """(count,) angular frequencies, rad/s, of a spinning disc without hole and bending stiffness, seen on the disc.

    8 omega^2 = Omega^2 [(3 + nu) m (m + 2) - (1 + 3 nu) n^2], m = n + 2 s, s nodal circles: Lamb and Southwell,
    Proc. R. Soc. A 99 (1921) 272.
    """
    n, m = diameters, diameters + 2 * np.arange(count)
    return speed * np.sqrt(((3 + poisson) * m * (m + 2) - (1 + 3 * poisson) * n**2) / 8)


def disc_frequencies(
    disc: Disc, diameters: int, count: int, speed: float = 0.0, shear: float = 5 / 6, terms: int = 18,
    coriolis: bool = False,
) -> Array:  # fmt: skip
    """(count,) angular frequencies of transverse waves of a spinning disc with shear and rotary inertia, rad/s.

    Mindlin's plate (J. Appl. Mech. 18 (1951) 31) under its centrifugal stress, by Ritz's method with Legendre
    polynomials along the radius, above the exact frequencies by some 2e-5: shear makes edge layers as narrow as the
    disc is thin. Rotary inertia carries the spin softening of in-plane motion.

    Args:
        shear: shear factor. terms: polynomials per field.
        coriolis: couples the two slopes by the Coriolis force; then these are the frequencies of the wave
            exp(i (n theta + omega t)), for which n < 0 may be given; without it the sign of n has no effect.
    """
    K, M, G = _ritz(disc, diameters, speed, shear, terms)
    if not coriolis:
        return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, count - 1]))
    zero = np.zeros_like(K)
    inverse = scipy.linalg.eigh(
        np.block([[G, M], [M, zero]]), np.block([[K, zero], [zero, M]]), eigvals_only=True
    )  # (K - omega G - omega^2 M) q = 0
    return np.sort(1 / inverse[inverse > 0])[:count]


def _ritz(disc: Disc, n: int, speed: float, shear: float, terms: int) -> tuple[Array, Array, Array]:
    """K, M, G over (w, psi_r, psi_theta), u = z psi: w and psi_r along cos, psi_theta along sin (n theta + omega t)."""
    a, b, h, nu = disc.inner, disc.outer, disc.thickness, disc.poisson
    x, weight = legendre.leggauss(3 * terms)
    r, dr = (a + b) / 2 + (b - a) / 2 * x, (b - a) / 2 * weight
    P = legendre.legvander(x, terms - 1)
    dP = np.stack([legendre.legval(x, legendre.legder(c)) for c in np.eye(terms)], axis=1) * 2 / (b - a)
    if disc.clamped:
        reach = (r - a)[:, None] / (b - a)
        P, dP = P * reach, dP * reach + P / (b - a)
    o, over = np.zeros_like(P), 1 / r[:, None]
    w, dw = np.hstack([P, o, o]), np.hstack([dP, o, o])
    p, dp = np.hstack([o, P, o]), np.hstack([o, dP, o])
    t, dt = np.hstack([o, o, P]), np.hstack([o, o, dP])

    def form(left: Array, right: Array, value: Array | float = 1.0) -> Array:
        return left.T @ (right * (value * r * dr)[:, None])

    radial, hoop = centrifugal_stress(disc, speed)(r)
    D, gamma = disc.rigidity, shear * disc.young / 2 / (1 + nu) * h
    bend, hoop_bend, twist = dp, (p + n * t) * over, dt - (t + n * p) * over
    along, across = dw + p, t - n * w * over
    cross = form(bend, hoop_bend)
    K = D * (form(bend, bend) + form(hoop_bend, hoop_bend) + nu * (cross + cross.T) + (1 - nu) / 2 * form(twist, twist))
    K += gamma * (form(along, along) + form(across, across))
    K += h * (form(dw, dw, radial) + n**2 * form(w * over, w * over, hoop))
    rotary = disc.density * h**3 / 12
    slopes = form(p, p) + form(t, t)
    K -= speed**2 * rotary * slopes
    M = disc.density * h * form(w, w) + rotary * slopes
    coupling = form(p, t)
    return K, M, 2 * speed * rotary * (coupling + coupling.T)
