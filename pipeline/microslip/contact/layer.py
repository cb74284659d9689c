"""The thin elastic layer (Sextro 3.1, 3.2): its stiffness, where it yields, and up to which frequency it is a spring.

The layer of depth l_0 is built in at its far side and loaded by a uniform pressure and shear; what holds it sideways
decides its normal stiffness (`BOUNDARIES`). Displacements are positive into the layer, pressure is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from ..data import Array, Indices
from ..errors import UserError
from .solids import Solid, doubles

STRESS_FREE, HYDROSTATIC, NO_LATERAL_STRAIN = BOUNDARIES = ("stress-free", "hydrostatic", "no-lateral-strain")
"""The book's i = 1, 2, 3: sides free (3.1-8), as much pressure from the sides (3.1-18), sides held (3.1-21)."""

DIRECTIONS = ("normal", "tangential")

REDUCED_MASS = 4 / np.pi**2
"""gamma of (3.2-27): share of an element's mass that, with its static stiffness, has its lowest eigenfrequency. Far
below that frequency a third of the mass is what acts (x cot x = 1 - x^2/3), so gamma overrates the inertia there."""


@dataclass(frozen=True)
class Layer:
    """An elastic layer under a contact.

    Attributes:
        solid: its material. thickness: l_0, m. boundary: one of `BOUNDARIES`. density: rho_0, kg/m3, needed for
            frequencies only.

    Raises:
        UserError: unknown boundary, thickness or density impossible, a layer that cannot be compressed.
    """

    solid: Solid
    thickness: float
    boundary: str = STRESS_FREE
    density: float | None = None

    def __post_init__(self) -> None:
        if self.boundary not in BOUNDARIES:
            raise UserError(f"'{self.boundary}' is unknown; choose one of {', '.join(BOUNDARIES)}", "boundary")
        if not 0 < self.thickness < np.inf:
            raise UserError(f"{self.thickness:g} m is no depth of a layer; it must be greater than 0", "thickness")
        if self.density is not None and not 0 < self.density < np.inf:
            raise UserError(f"{self.density:g} kg/m3 is impossible; it must be greater than 0", "density")
        if self.boundary != STRESS_FREE and self.solid.poisson >= 0.5:
            raise UserError("0.5 and held sides make a layer that cannot be compressed; take 0.49, say", "poisson")

    @property
    def modulus(self) -> float:
        """E~_i, Pa: normal stress over normal strain, Sextro Eq. (3.2-4)."""
        E, nu = self.solid.young, self.solid.poisson
        if self.boundary == STRESS_FREE:
            return E
        if self.boundary == HYDROSTATIC:
            return E / (1 - 2 * nu)
        return E * (1 - nu) / ((1 - 2 * nu) * (1 + nu))

    @property
    def lateral_share(self) -> float:
        """s_i: pressure on the sides over the contact pressure, Sextro Eq. (3.1-28)."""
        nu = self.solid.poisson
        return {STRESS_FREE: 0.0, HYDROSTATIC: 1.0, NO_LATERAL_STRAIN: nu / (1 - nu)}[self.boundary]

    # stiffness -----------------------------------------------------------------------------------------------------

    def normal_stiffness(self, area: ArrayLike) -> Array:
        """c_N0 (N/m) of elements of the given areas (m2, any shape), Sextro Eqs. (3.1-15), (3.1-20), (3.1-24)."""
        return self.modulus * doubles(area) / self.thickness

    def tangential_stiffness(self, area: ArrayLike) -> Array:
        """c_R0 (N/m), the same along both tangents, Sextro Eq. (3.1-16)."""
        return self.solid.shear * doubles(area) / self.thickness

    def lengthening_error(self, approach: ArrayLike) -> Array:
        """Relative error of a force that is computed with l_0 instead of the deformed length, Sextro Eq. (3.1-17).

        -u/l_0: negative where the layer is pressed. Up to 2 or 4 % the book lets it pass; beyond, the hyperbolic law
        (3.4-2) counts the length.

        Args:
            approach: u_P, m, any shape.
        """
        return -doubles(approach) / self.thickness

    # yield ---------------------------------------------------------------------------------------------------------

    def shear_stress(self, pressure: ArrayLike, shear: ArrayLike) -> Array:
        """Largest shear stress (Pa) in the layer, half of Tresca's equivalent stress, Sextro Eq. (3.1-30).

        sqrt(tau^2 + (1 - s_i)^2 p^2 / 4); sigma_yy always lies between the other two principal stresses.

        Args:
            pressure: (n,) Pa. shear: (n,) Pa, or (n, 2) along t1 and t2, whose resultant counts.
        """
        tau = doubles(shear)
        tau = np.hypot(tau[..., 0], tau[..., 1]) if tau.ndim > np.ndim(pressure) else tau
        return np.hypot(tau, 0.5 * (1 - self.lateral_share) * doubles(pressure))

    def shear_strength(self, pressure: ArrayLike, yield_shear: ArrayLike) -> Array:
        """tau_max (Pa) that the layer carries beside a pressure before it flows, Sextro Eqs. (3.1-33), (3.1-36).

        sqrt(tau_S^2 - (1 - s_i)^2 p^2 / 4), zero from p = 2 tau_S/(1 - s_i) on (3.1-35).

        Args:
            pressure: Pa. yield_shear: tau_S at the temperature there, Pa, one value or one a point.
        """
        p, tau_s = np.broadcast_arrays(doubles(pressure), _yield_shear(yield_shear))
        half = 0.5 * (1 - self.lateral_share) * p
        return np.sqrt(np.maximum((tau_s - half) * (tau_s + half), 0.0))

    def largest_friction(self, pressure: ArrayLike, yield_shear: ArrayLike) -> Array:
        """mu_max of Sextro Eq. (3.1-33): no friction coefficient above it is possible; infinite without pressure."""
        p = doubles(pressure)
        strength = self.shear_strength(p, yield_shear)
        return np.divide(strength, p, out=np.full(strength.shape, np.inf), where=np.broadcast_to(p > 0, strength.shape))

    def check_yield(
        self, pressure: ArrayLike, shear: ArrayLike, yield_shear: ArrayLike, points: ArrayLike | None = None,
        names: Sequence[str] | None = None,
    ) -> YieldCheck:  # fmt: skip
        """Whether the layer stays elastic everywhere, Sextro Eq. (3.1-31).

        Args:
            pressure: (n,) Pa. shear: (n,) or (n, 2) Pa. yield_shear: tau_S, Pa, one value or one a point; half the
                yield stress of a tensile test. points: (n, 3) coordinates, m. names: of the points.

        Raises:
            UserError: numbers that are not finite, a negative pressure, lists of different length.
        """
        p = np.atleast_1d(doubles(pressure))
        tau = doubles(shear)
        tau = np.broadcast_to(tau, p.shape) if tau.ndim < 2 and tau.size == 1 else tau
        limit, xyz = _yield_shear(yield_shear), None if points is None else doubles(points)
        for name, value in (("shear", tau), ("yield_shear", limit), ("points", xyz), ("names", names)):
            if value is not None and np.ndim(value) and len(value) not in (len(p), 1 if name == "yield_shear" else -1):
                raise UserError(f"{name}: {len(value)} entries for {len(p)} pressures; give one a point")
        for name, value in (("pressure", p), ("shear", tau)):
            bad = np.flatnonzero(~np.isfinite(value).reshape(len(p), -1).all(axis=1))
            if len(bad):
                raise UserError(f"{name}: entry {bad[0] + 1} is not finite; correct it")
        if (p < 0).any():
            raise UserError(f"entry {p.argmin() + 1} is {p.min():g} Pa; a contact does not pull", "pressure")
        utilisation = self.shear_stress(p, tau) / limit
        return YieldCheck(utilisation, p, xyz, None if names is None else tuple(names))

    # dynamics ------------------------------------------------------------------------------------------------------

    def eigenfrequencies(self, direction: str, count: int = 1) -> Array:
        """(count,) rad/s of the layer with its surface free, Sextro Eqs. (3.2-14), (3.2-25).

        (2k - 1) pi/(2 l_0) sqrt(E~_i/rho_0) or, tangentially, with G.

        Raises:
            UserError: no density, unknown direction.
        """
        k = np.arange(1, count + 1)
        return (2 * k - 1) * np.pi / (2 * self.thickness) * np.sqrt(self._modulus(direction) / self._rho())

    def reduced_mass(self, area: ArrayLike) -> Array:
        """Delta m_D0 = (4/pi^2) rho_0 A l_0 (kg) of elements of the given areas, Sextro Eqs. (3.2-27), (3.2-28)."""
        return REDUCED_MASS * self._rho() * doubles(area) * self.thickness

    def quasi_static(self, frequency: float, tolerance: float = 0.01) -> FrequencyMargin:
        """Whether the static stiffness may be used up to a frequency, and by what margin, Sextro Eq. (3.2-31).

        The criterion that the book's "very small" stands for: the static stiffness exceeds the exact dynamic one by
        tan(x)/x - 1, x = (pi/2) (f/f_1), f_1 the lower of the two first eigenfrequencies; that must not be more than
        the tolerance. For small ratios it is (pi^2/12) (f/f_1)^2: 1 % at f_1/9.

        Args:
            frequency: highest one of the motion, Hz. tolerance: relative error of the stiffness.

        Raises:
            UserError: no density, a negative frequency, a tolerance that is not positive.
        """
        if not 0 <= frequency < np.inf:
            raise UserError(f"{frequency:g} Hz is none; it must not be negative", "frequency")
        if not 0 < tolerance < np.inf:
            raise UserError(f"{tolerance:g} must be greater than 0, 0.01 for 1 %", "tolerance")
        first = {d: float(self.eigenfrequencies(d)[0]) / (2 * np.pi) for d in DIRECTIONS}
        direction = min(first, key=lambda d: first[d])
        errors = {d: quasi_static_error(frequency / f) for d, f in first.items()}
        allowed = first[direction] * _ratio_of_error(tolerance)
        return FrequencyMargin(
            frequency, direction, first["normal"], first["tangential"], errors["normal"], errors["tangential"],
            tolerance, allowed,
        )  # fmt: skip

    def _modulus(self, direction: str) -> float:
        if direction not in DIRECTIONS:
            raise UserError(f"'{direction}' is unknown; choose one of {', '.join(DIRECTIONS)}", "direction")
        return self.modulus if direction == "normal" else self.solid.shear

    def _rho(self) -> float:
        if self.density is None:
            raise UserError("not given, and a frequency needs it; 7850 kg/m3 for steel", "density")
        return self.density


@dataclass(frozen=True)
class YieldCheck:
    """Where a layer is overloaded.

    Attributes:
        utilisation: (n,) largest shear stress over tau_S; from 1 on the point flows. pressure: (n,) Pa.
        points: (n, 3) m, or None. names: of the points, or None.
    """

    utilisation: Array
    pressure: Array
    points: Array | None = None
    names: tuple[str, ...] | None = None

    @property
    def overloaded(self) -> Indices:
        """Indices of the points that yield, the worst first."""
        found = np.flatnonzero(self.utilisation >= 1)
        return found[np.argsort(-self.utilisation[found], kind="stable")]

    @property
    def elastic(self) -> bool:
        """True if no point yields."""
        return not len(self.overloaded)

    def label(self, i: int) -> str:
        """A point by its name, its coordinates in mm, or its number, counted from 1."""
        if self.names is not None:
            return self.names[i]
        if self.points is not None:
            return "(" + ", ".join(f"{1e3 * x:.4g}" for x in self.points[i]) + ") mm"
        return f"point {i + 1}"

    def sentence(self, most: int = 5) -> str:
        """Which points are overloaded and by how much; at most so many are named."""
        n, found = len(self.utilisation), self.overloaded
        if self.elastic:
            if not n:
                return "There is no point to check for yield."
            worst = int(self.utilisation.argmax())
            share = self.utilisation[worst]
            return f"The contact stays elastic: at most {100 * share:.3g} % of the yield limit, at {self.label(worst)}."
        named = ", ".join(f"{self.label(i)} ({100 * self.utilisation[i]:.4g} %)" for i in found[:most])
        more = f" and {len(found) - most} more" if len(found) > most else ""
        return f"The contact yields at {len(found)} of {n} points: {named}{more} of the yield limit by Tresca."


@dataclass(frozen=True)
class FrequencyMargin:
    """Whether a contact may be taken for a spring.

    Attributes:
        frequency: asked for, Hz. direction: the softer one, ``normal`` or ``tangential``. first_normal,
            first_tangential: first eigenfrequencies of the layer, Hz. normal_error, tangential_error: by which share
            the static stiffness is too large at the frequency; infinite from the eigenfrequency on. tolerance: that
            the error is held against. allowed: frequency up to which it is met, Hz.
    """

    frequency: float
    direction: str
    first_normal: float
    first_tangential: float
    normal_error: float
    tangential_error: float
    tolerance: float
    allowed: float

    @property
    def error(self) -> float:
        """The larger of the two."""
        return max(self.normal_error, self.tangential_error)

    @property
    def ok(self) -> bool:
        """Whether the quasi-static law may be used."""
        return self.error <= self.tolerance

    @property
    def margin(self) -> float:
        """Allowed frequency over the frequency asked for; infinite at rest."""
        return self.allowed / self.frequency if self.frequency else np.inf

    def sentence(self) -> str:
        """May the quasi-static law be used, and by what margin."""
        first = min(self.first_normal, self.first_tangential)
        verdict = "may" if self.ok else "must not"
        error = f"{100 * self.error:.2g} % too stiff" if np.isfinite(self.error) else "meaningless"
        return (
            f"At {self.frequency:.4g} Hz the quasi-static contact law {verdict} be used: it is {error} there "
            f"({self.direction} eigenfrequency of the layer {first:.4g} Hz), and {100 * self.tolerance:.2g} % are "
            f"reached at {self.allowed:.4g} Hz."
        )


def modal_stiffness(modes: int) -> float:
    """c_M*: static stiffness that so many modes of the layer have, over the exact one, Sextro Eq. (3.2-20).

    pi^2 / (8 sum of 1/(2k - 1)^2). Too stiff by 4.2 % with 5 modes and by 1.02 % with 20 (the book: "less than 1 %").
    """
    k = np.arange(modes, 0, -1)  # the small ones first
    return float(np.pi**2 / (8 * np.sum(1.0 / (2 * k - 1.0) ** 2)))


def quasi_static_error(ratio: float) -> float:
    """Share by which the static stiffness exceeds the one at `ratio` times the first eigenfrequency; inf from 1 on."""
    if ratio >= 1:
        return np.inf
    return float(1 / _x_cot_x(np.asarray(0.5 * np.pi * ratio)) - 1)


def _ratio_of_error(error: float) -> float:
    return float(brentq(lambda r: quasi_static_error(r) - error, 0.0, 1 - 1e-12)) if error < 1e11 else 1.0


def _x_cot_x(x: Array) -> Array:
    small = np.abs(x) < 1e-4
    safe = np.where(small, 1.0, x)
    return np.where(small, 1 - x * x / 3, safe * np.cos(safe) / np.sin(safe))


def _yield_shear(value: ArrayLike) -> Array:
    tau_s = doubles(value)
    if not ((tau_s > 0) & np.isfinite(tau_s)).all():
        raise UserError("must be greater than 0 Pa; half the yield stress of a tensile test", "yield_shear")
    return tau_s
