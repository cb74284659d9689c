"""Round contacts of any axisymmetric shape: Galin's and Sneddon's transform, and the tangential side of it.

A profile f(r) is the gap of the two bodies at first touch. Its transform

    g(x) = x integral_0^x f'(r) / sqrt(x^2 - r^2) dr

is the approach at which the contact radius is x (Galin 1946, Sneddon 1965; Popov and Hess, Method of Dimensionality
Reduction, 3). Materials enter through E* and G* only; the coupling of `solids.mismatch` is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

from ..data import Array, Indices
from ..errors import UserError
from .solids import Solid, doubles, normal_modulus, pressing, tangential_modulus

_RULES = {n: np.polynomial.legendre.leggauss(n) for n in (4, 16)}
_DEGREE = 14
_SHRINK = 0.5 ** np.arange(20, -1, -1.0)
"""Ends of panels, each half as wide as the next one out: what f does at r = 0 (r^1.5, say) is left to the innermost.
Not more of them: a function like R - sqrt(R^2 - r^2) has no digits left further in."""


@dataclass(frozen=True)
class Profile:
    """Gap at first touch over the distance from the axis.

    Attributes:
        breaks: (k + 1,) m, ascending from 0; the profile is smooth between them. value, slope, curvature: f, f' and
            f'' (m, 1, 1/m), vectorised. corners: (c,) m, where the slope jumps, and by how much: jumps: (c,).
    """

    breaks: Array
    value: Callable[[Array], Array]
    slope: Callable[[Array], Array]
    curvature: Callable[[Array], Array]
    corners: Array = field(default_factory=lambda: np.zeros(0))
    jumps: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def radius(self) -> float:
        """Where the profile ends, m."""
        return float(self.breaks[-1])

    @staticmethod
    def of_table(radius: ArrayLike, gap: ArrayLike, name: str = "profile") -> Profile:
        """A measured profile: (k,) radii from 0 on and gaps, m; a C1 curve without overshoot (PCHIP) through them.

        The gap at r = 0 is taken off. The profile may be hollow between rings; whether the contact is one disc is
        checked by `RoundContact`.

        Raises:
            UserError: fewer than 3 points, not finite, radii that do not rise or do not begin at 0.
        """
        r, f = map(doubles, (radius, gap))
        if r.ndim != 1 or r.shape != f.shape or len(r) < 3:
            raise UserError(f"{name}: needs at least three radii with one gap each")
        for what, v in (("radius", r), ("gap", f)):
            bad = np.flatnonzero(~np.isfinite(v))
            if len(bad):
                raise UserError(f"{name}: {what}: entry {bad[0] + 1} is not finite; correct it")
        fall = np.flatnonzero(np.diff(r) <= 0)
        if len(fall) or r[0] != 0:
            where = f"entry {fall[0] + 2} does not rise" if len(fall) else f"it begins at {r[0]:g} m instead of 0"
            raise UserError(f"{name}: radius: must rise from 0: {where}")
        curve = PchipInterpolator(r, f - f[0])
        return Profile(r, curve, curve.derivative(), curve.derivative(2))

    @staticmethod
    def of_function(value: Callable[[Array], Array], radius: float, corners: Sequence[float] = ()) -> Profile:
        """A profile given by a function of r (vectorised, m), up to a radius; corners: where its slope jumps, m.

        Interpolated by polynomials on panels that shrink towards the axis.

        Raises:
            UserError: a function that is not finite there, a corner outside.
        """
        ends = [0.0, *sorted(corners), float(radius)]
        if not np.isfinite(ends).all() or (np.diff(ends) <= 0).any():
            raise UserError(f"corners: must lie between 0 and the radius {radius:g} m, each once")
        breaks = np.unique(np.concatenate([_panels(a, b) for a, b in zip(ends, ends[1:], strict=False)]))
        zero = float(np.asarray(value(np.zeros(1)))[0])
        curve = _Piecewise.of(lambda r: doubles(value(r)) - zero, breaks)
        slope, at = curve.derivative(), np.array(ends[1:-1])
        before = np.searchsorted(breaks, at) - 1
        jumps = slope.at_ends(before + 1)[0] - slope.at_ends(before)[1]
        return Profile(breaks, curve, slope, slope.derivative(), at, jumps)

    @staticmethod
    def power(exponent: float, gap: float, at: float, radius: float) -> Profile:
        """f = gap (r/at)^exponent up to a radius, m: 1 a cone, 2 a paraboloid (the sphere of radius at^2/(2 gap))."""
        return Profile.of_function(lambda r: gap * (r / at) ** exponent, radius)

    def transform(self, x: ArrayLike) -> Array:
        """g(x), m, at radii (m, any shape) up to `radius`."""
        return self._integrals(x)[0]

    def _integrals(self, x: ArrayLike) -> tuple[Array, Array]:
        """g(x) and its integral from 0 to x, m and m2: x int f'(x sin t) dt and x int f(x sin t) sin t dt."""
        flat = np.atleast_1d(doubles(x)).ravel()
        both = np.array([self._at(v) for v in flat]).reshape(-1, 2)
        return both[:, 0].reshape(np.shape(x)), both[:, 1].reshape(np.shape(x))

    def _at(self, x: float) -> tuple[float, float]:
        if x <= 0:
            return 0.0, 0.0
        r, w = self._nodes(x)
        return float(x * np.sum(w * self.slope(r))), float(np.sum(w * self.value(r) * r))

    def rise(self, x: float) -> float:
        """g'(x) = int f' dt + int f'' r dt (1) without what the corners add, jump c / sqrt(x^2 - c^2) each."""
        r, w = self._nodes(x)
        return float(np.sum(w * (self.slope(r) + self.curvature(r) * r)))

    def _nodes(self, x: float) -> tuple[Array, Array]:
        """Quadrature of an integral over t from 0 to pi/2 of a function of r = x sin t: r and weights."""
        inner = self.breaks[(self.breaks > 0) & (self.breaks < x)]
        ends = np.concatenate([[0.0], np.arcsin(inner / x), [0.5 * np.pi]])
        t, w = _quadrature(ends)
        return x * np.sin(t), w


def _quadrature(ends: Array) -> tuple[Array, Array]:
    """Gauss points and weights, (k, 4 or 16), between neighbouring ends; many pieces, of a table, need few points."""
    nodes, weights = _RULES[16 if len(ends) < 60 else 4]
    half = 0.5 * np.diff(ends)[:, None]
    return ends[:-1, None] + half * (1 + nodes), half * weights


def _panels(low: float, high: float) -> Array:
    """Ends of the panels of a smooth piece: halving towards the axis, even elsewhere."""
    return np.concatenate([[0.0], high * _SHRINK]) if low == 0 else np.linspace(low, high, 9)


@dataclass(frozen=True)
class _Piecewise:
    """Chebyshev interpolants on panels. breaks: (k + 1,) m. series: (d + 1, k), of -1..1 on each panel."""

    breaks: Array
    series: Array

    @staticmethod
    def of(value: Callable[[Array], Array], breaks: Array) -> _Piecewise:
        nodes = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
        r = breaks[:-1, None] + 0.5 * np.diff(breaks)[:, None] * (1 + nodes)
        f = value(r.ravel()).reshape(r.shape)
        if not np.isfinite(f).all():
            bad = r[~np.isfinite(f)].min()
            raise UserError(f"profile: is not finite at r = {bad:g} m; correct the function or give a smaller radius")
        return _Piecewise(breaks, chebyshev.chebfit(nodes, f.T, _DEGREE))

    def __call__(self, r: Array) -> Array:
        k = np.clip(np.searchsorted(self.breaks, r, side="right") - 1, 0, len(self.breaks) - 2)
        width = self.breaks[k + 1] - self.breaks[k]
        return chebyshev.chebval(2 * (r - self.breaks[k]) / width - 1, self.series[:, k], tensor=False)

    def at_ends(self, panels: Indices) -> tuple[Array, Array]:
        """Values at the left and at the right end of panels."""
        series = self.series[:, panels]
        return np.asarray(chebyshev.chebval(-1.0, series)), np.asarray(chebyshev.chebval(1.0, series))

    def derivative(self) -> _Piecewise:
        return _Piecewise(self.breaks, chebyshev.chebder(self.series) * (2 / np.diff(self.breaks)))


@dataclass(frozen=True)
class RoundContact:
    """Two bodies of axisymmetric shape pressed together along the axis.

    Attributes:
        first, second: their materials. profile: the gap between them. edge: whether the body ends at the profile's
            radius, as a stamp does; then a larger approach leaves the contact radius there. modulus, shear_modulus:
            E*, G*, Pa.

    Raises:
        UserError: two rigid bodies, a profile whose contact is not one growing disc (it must not touch in a ring).
    """

    first: Solid
    second: Solid
    profile: Profile
    edge: bool = False
    modulus: float = field(init=False)
    shear_modulus: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "modulus", normal_modulus(self.first, self.second))
        object.__setattr__(self, "shear_modulus", tangential_modulus(self.first, self.second))
        a, g = self._table
        fall = np.flatnonzero(np.diff(g) < -1e-12 * np.abs(g).max())
        if len(fall):
            raise UserError(
                f"profile: the contact would not be one disc: beyond r = {a[fall[0]]:.4g} m it touches in a ring; give "
                "the profile up to there, or one whose gap rises more steadily"
            )

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Contact radii from 0 on and the approaches they belong to, m."""
        R = self.profile.radius
        a = np.unique(np.concatenate([[0.0], R * _SHRINK, np.linspace(0, R, 201)[1:], self.profile.breaks]))
        return a, self.profile.transform(a)

    def radius_at(self, approach: ArrayLike) -> Array:
        """Contact radius (m) at an approach (m, any shape).

        Raises:
            UserError: it would be larger than the profile, which has no edge.
        """
        d = doubles(approach)
        return np.array([self._radius(v) for v in np.atleast_1d(d).ravel()]).reshape(d.shape)

    def _radius(self, approach: float) -> float:
        a, g = self._table
        if approach >= g[-1]:
            if not self.edge and approach > g[-1] * (1 + 1e-12):
                raise UserError(
                    f"profile: is known up to r = {a[-1]:.4g} m only, where the approach is {g[-1]:.4g} m; "
                    f"{approach:.4g} m needs a wider one (edge = true if the body ends there)"
                )
            return float(a[-1])
        if approach <= 0:
            return 0.0
        i = int(np.argmax(g > approach))  # the first one, where rounding makes g flat
        excess = lambda x: self.profile._at(x)[0] - approach  # noqa: E731
        return float(brentq(excess, a[i - 1], a[i], xtol=1e-15 * a[-1], rtol=1e-14))

    def force(self, approach: ArrayLike) -> Array:
        """Normal force (N): 2 E* integral_0^a (approach - g(x)) dx; zero where the bodies are apart."""
        d = np.maximum(doubles(approach), 0.0)
        a = self.radius_at(d)
        return 2 * self.modulus * np.maximum(a * d - self.profile._integrals(a)[1], 0.0)

    def approach(self, force: ArrayLike) -> Array:
        """Approach (m) under a normal force (N, not negative).

        Raises:
            UserError: a negative force, or one that needs a wider profile.
        """
        F = pressing(force)
        return np.array([self._approach(v) for v in F.ravel()]).reshape(F.shape)

    def _approach(self, force: float) -> float:
        a, g = self._table
        top = float(self.force(g[-1]))
        if force >= top:
            if force > top * (1 + 1e-12) and not self.edge:
                raise UserError(
                    f"profile: is known up to r = {a[-1]:.4g} m only, which a force of {top:.4g} N closes; "
                    f"{force:.4g} N need a wider one (edge = true if the body ends there)"
                )
            return float(g[-1] + (force - top) / (2 * self.modulus * a[-1]))
        if force == 0:
            return 0.0
        return float(brentq(lambda d: float(self.force(d)) - force, 0.0, g[-1], xtol=1e-14 * g[-1], rtol=1e-13))

    def radius(self, force: ArrayLike) -> Array:
        """Contact radius (m) under a normal force (N, any shape)."""
        return self.radius_at(self.approach(force))

    def area(self, force: ArrayLike) -> Array:
        """Contact area (m2) under a normal force (N)."""
        return np.pi * self.radius(force) ** 2

    def pressure(self, force: float, r: ArrayLike) -> Array:
        """Pressure (Pa) at distances r (m) from the axis; zero outside, infinite at a tip, a ridge, a sharp edge.

        p(r) = (E*/pi) (integral_r^a g'(x)/sqrt(x^2 - r^2) dx + (approach - g(a))/sqrt(a^2 - r^2)).
        """
        approach, at = float(self.approach(force)), doubles(r)
        a = self._radius(approach)
        beyond = max(approach - float(self.profile.transform(a)), 0.0) if self.edge else 0.0
        return np.array([self._pressure(abs(v), a, beyond) for v in np.atleast_1d(at).ravel()]).reshape(at.shape)

    def _pressure(self, r: float, a: float, beyond: float) -> float:
        if r > a or a == 0 or (r == a and not beyond):
            return 0.0
        if r == a or (r == 0 and self._pointed) or r in self.profile.corners:
            return np.inf
        breaks = self.profile.breaks
        t = np.sqrt(np.maximum(np.concatenate([[r], breaks[(breaks > r) & (breaks < a)], [a]]) ** 2 - r * r, 0.0))
        at, weight = _quadrature(t)
        x = np.hypot(r, at)  # takes the root out of the integral
        rise = np.array([self.profile.rise(v) for v in x.ravel()]).reshape(x.shape)
        smooth = float(np.sum(weight * rise / x))
        ridges = sum(
            jump * _ridge(r, c, a) for c, jump in zip(self.profile.corners, self.profile.jumps, strict=True) if c < a
        )
        return float(self.modulus / np.pi * (smooth + ridges + beyond / np.sqrt((a - r) * (a + r))))

    @property
    def _pointed(self) -> bool:
        """Whether the tip is a cone's; 1e-3 of the mean slope is what r^1.5 has left in the innermost panel."""
        tip, mean = float(self.profile.slope(np.zeros(1))[0]), float(self.profile.value(self.profile.breaks[-1:])[0])
        return abs(tip) * self.profile.radius > 1e-3 * 3 * abs(mean)

    def normal_stiffness(self, force: ArrayLike) -> Array:
        """dF/d(approach) = 2 E* a, N/m, whatever the profile."""
        return 2 * self.modulus * self.radius(force)

    def stiffness_at(self, approach: ArrayLike) -> Array:
        """dF/d(approach), N/m, at an approach (m, any shape), without a search for the force's."""
        return 2 * self.modulus * self.radius_at(approach)

    def tangential_stiffness(self, force: ArrayLike) -> tuple[Array, Array]:
        """(x, y): 2 G* a, N/m, of the sticking contact, the same along both (Mindlin 1949; Jaeger 1995)."""
        k = 2 * self.shear_modulus * self.radius(force)
        return k, k

    @property
    def tangential_ratio(self) -> tuple[float, float]:
        """Tangential over normal stiffness while all of the contact sticks: G*/E*, whatever profile and force."""
        return (self.shear_modulus / self.modulus,) * 2


def _ridge(r: float, c: float, a: float) -> float:
    """c integral of dx / sqrt((x^2 - r^2)(x^2 - c^2)) from the larger of r and c to a."""
    low, high = sorted((r, c))
    m = (low / high) ** 2
    return float(c / high * (ellipk(m) - ellipkinc(np.arcsin(high / a), m)))
