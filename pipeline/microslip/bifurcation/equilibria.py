"""Equilibria f(x, p) = 0 over the parameter, and Hopf points on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..continuation import Lost, Scaled, Segment, Settings, root
from ..continuation.curve import State
from ..data import Array, ComplexArray
from ..errors import UserError
from .dynamics import Dynamics


@dataclass(frozen=True, eq=False)
class Still:
    """f(x, p) = 0: `continuation.Equations`."""

    system: Dynamics

    @property
    def x_scale(self) -> Array:
        return np.asarray(self.system.scale)

    @property
    def lam_scale(self) -> float:
        return self.system.parameter_scale

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        f, J, slope = self.system.still(x, float(lam))
        return np.asarray(f), np.asarray(J), np.asarray(slope)


@dataclass(frozen=True)
class Hopf:
    """Where a pair of eigenvalues passes the imaginary axis.

    Attributes:
        x: (n,). p. omega: rad/s. shape: (n,) complex eigenvector to i omega, the largest entry over its scale 1.
        criticality: first Lyapunov coefficient of a shape of unit length: negative, orbits born there are as stable as
            the equilibrium was (supercritical); positive, less (subcritical).
    """

    x: Array
    p: float
    omega: float
    shape: ComplexArray
    criticality: float


def eigenvalues(system: Dynamics, x: Array, p: float) -> ComplexArray:
    """(n,) of the linearised system, the largest real part first."""
    values = np.linalg.eigvals(np.asarray(system.still(x, p)[1])).astype(complex)
    return values[np.argsort(-values.real, kind="stable")]


def hopf_between(system: Dynamics, before: State, after: State, settings: Settings) -> list[Hopf]:
    """The Hopf points between two neighbouring states of the curve.

    Raises:
        UserError: roots meet on the imaginary axis, as they do without damping.
    """
    scaled = Scaled(Still(system))

    def real(k: int) -> Callable[[Array, Array], float]:
        return lambda y, _: float(eigenvalues(system, y[:-1] * scaled.x_scale, y[-1] * scaled.lam_scale)[k].real)

    ends = [eigenvalues(system, s.y[:-1] * scaled.x_scale, s.y[-1] * scaled.lam_scale) for s in (before, after)]
    counts = sorted(int((e.real > 0).sum()) for e in ends)
    segment = Segment(before.y, after.y, before.tangent, after.tangent, False)
    points = list[Hopf]()
    for k in range(counts[0], counts[1] - 1, 2):
        try:
            y, _ = root(scaled, segment, settings, real(k), 1e-6)
        except Lost:
            continue
        x, p = y[:-1] * scaled.x_scale, float(y[-1] * scaled.lam_scale)
        values = eigenvalues(system, x, p)
        pairs = values[values.imag > 1e-6 * np.abs(values).max()]
        if len(pairs):
            point = _sought(system, x, p, float(pairs[np.argmin(np.abs(pairs.real))].imag))
            new = [
                h for h in (point, *_beside(system, point)) if not any(_is_same(system, h, other) for other in points)
            ]
            points += new[:1]
    return points


NEAR = 1e-5
"""Share of the largest eigenvalue within which another one is on the imaginary axis too, of its frequency within which
two are one, and of the scales within which two points of a branch are."""


def _beside(system: Dynamics, one: Hopf) -> Iterator[Hopf]:
    """The Hopf points at the same place, where rounding alone chooses which pair is nearest to the axis."""
    values = eigenvalues(system, one.x, one.p)
    size = NEAR * np.abs(values).max()
    for value in values[(values.imag > size) & (np.abs(values.real) < size)]:
        if abs(value.imag - one.omega) > NEAR * one.omega:
            yield _sought(system, one.x, one.p, float(value.imag))


def _is_same(system: Dynamics, one: Hopf, other: Hopf) -> bool:
    apart = np.abs((one.x - other.x) / np.asarray(system.scale)).max()
    place = max(apart, abs(one.p - other.p) / system.parameter_scale) < NEAR
    return bool(place and abs(one.omega - other.omega) < NEAR * one.omega)


def _sought(system: Dynamics, x: Array, p: float, omega: float) -> Hopf:
    try:
        point = hopf(system, x, p, omega)
    except (Lost, np.linalg.LinAlgError) as error:
        _refuse_alike(system, x, p, omega, NEAR)
        raise UserError(
            f"near {p:.4g} of the parameter no single pair of roots crosses the imaginary axis at {omega:.4g} rad/s: "
            "without damping pairs run along it until two of them meet; give the bodies damping"
        ) from error
    _refuse_alike(system, point.x, point.p, point.omega, ALIKE)
    return point


ALIKE = 1e-9
"""Share of the frequency within which two pairs of roots are one where a Hopf point was found."""


def _refuse_alike(system: Dynamics, x: Array, p: float, omega: float, within: float) -> None:
    """Raise `UserError` where several pairs have one frequency: each has a shape; two that meet
    have one."""
    size = np.asarray(system.scale)
    J = np.asarray(system.still(x, p)[1]) * size / size[:, None]
    if (scipy.linalg.svdvals(J - 1j * omega * np.eye(system.count)) < within * omega).sum() > 1:
        raise UserError(
            f"near {p:.4g} of the parameter several pairs of roots cross the imaginary axis at {omega:.4g} rad/s: "
            "parts that are alike and not coupled; follow one of them, or couple them"
        )


def hopf(system: Dynamics, x: Array, p: float, omega: float) -> Hopf:
    """The Hopf point near a guess, by Newton's method on f = 0, J v = i omega v, c . v = 1 for all at once.

    Raises:
        Lost: it does not converge from there.
    """
    n, dz = system.count, np.zeros(1)
    values, vectors = np.linalg.eig(np.asarray(system.still(x, p)[1]))
    v = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    v = v / v[np.argmax(np.abs(v / np.asarray(system.scale)))]
    c = np.conj(v) / (np.abs(v) ** 2).sum()

    z = np.concatenate([x, [p], v.real, v.imag, [omega]])
    for _ in range(30):
        F, slope = map(np.asarray, system.hopf(z, c.real, c.imag))
        dz = np.linalg.solve(slope, F)
        z = z - dz
        if np.abs(dz).max() <= 1e-13 * (1 + np.abs(z).max()):
            break
    if not np.isfinite(z).all() or np.abs(dz).max() > 1e-9 * (1 + np.abs(z).max()):
        raise Lost
    shape = z[n + 1 : 2 * n + 1] + 1j * z[2 * n + 1 : 3 * n + 1]
    return Hopf(z[:n], float(z[n]), float(z[-1]), shape, lyapunov(system, z[:n], float(z[n]), float(z[-1])))


def lyapunov(system: Dynamics, x: Array, p: float, omega: float) -> float:
    """First Lyapunov coefficient of a Hopf point (Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, Eq. (5.34)),
    coordinates over their scales."""
    size = np.asarray(system.scale)
    at = x / size

    def form(*ways: Array) -> Array:
        total = np.zeros(len(at), dtype=complex)
        for parts in np.ndindex(*(2,) * len(ways)):
            real = [w.imag if i else w.real for w, i in zip(ways, parts, strict=True)]
            total += 1j ** sum(parts) * np.asarray(system.forms[len(ways) - 2](at, p, *real))
        return total

    J = np.asarray(system.still(x, p)[1]) * size / size[:, None]
    q, left = _eigenvector(J, 1j * omega), _eigenvector(J.T, -1j * omega)
    left = left / np.conj(np.vdot(left, q))
    mean, second = np.linalg.solve(J, form(q, q.conj())), np.linalg.solve(2j * omega * np.eye(len(at)) - J, form(q, q))
    total = form(q, q, q.conj()) - 2 * form(q, mean) + form(q.conj(), second)
    return float(np.vdot(left, total).real / (2 * omega))


def _eigenvector(J: Array, value: complex) -> ComplexArray:
    values, vectors = np.linalg.eig(J)
    return vectors[:, np.argmin(np.abs(values - value))]
