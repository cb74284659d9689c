"""How blades answer to small deviations: Sextro's approximation of a mistuned ring from its tuned solution (5.6).

With friction the stiffness of the contacts depends on the motion, so that the derivative is that of the balance
R(x, p) = 0 (for one that does not, Eq. (5.6-3) is the same):

    dy/dp = y_p - y_x (dR/dx)^-1 R_p

By the symmetry of the tuned ring a blade answers to the deviation of another one as blade 0 does to that of one as far
away, so the solutions for the deviations of blade 0 hold all sensitivities of the ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array, ComplexArray
from ..harmonic_balance.problem import AtFrequency
from ..harmonic_balance.solver import Point
from .ring import Tuned, deviated
from .samples import Asked, read
from .scatter import Scatter
from .weibull import exponent, median, quantile


@dataclass(frozen=True)
class Approximation:
    """A mistuned ring by first order (Sextro Eqs. (5.6-1) to (5.6-18)).

    Attributes:
        frequency: (f,) Hz. mean: (f,) amplitude of the tuned ring. sensitivity: (f, sectors, modes) change of blade 0's
            amplitude by the relative deviation of the modes of a blade so many sectors further. deviation: (f,)
            standard deviation of the amplitude.
    """

    frequency: Array
    mean: Array
    sensitivity: Array
    deviation: Array

    @property
    def weibull_exponent(self) -> Array:
        """(f,) k by Eq. (5.6-17)."""
        return exponent(self.deviation / self.mean)

    def envelope(self, share: float) -> Array:
        """(f,) amplitude below which a share of the blades is, of Weibull's distribution."""
        k = self.weibull_exponent
        return quantile(share, median(self.mean, k), k)


def approximation(asked: Asked, scatter: Scatter) -> Approximation:
    """First order in the deviations of one scatter of frequencies, about the tuned ring's solutions."""
    points = asked.tuned_points
    found = [sensitivities(asked, scatter, point) for point in points]
    mean, S = np.array([m for m, _ in found]), np.array([s for _, s in found])
    alone, common = (S**2).sum(axis=(1, 2)), (S.sum(axis=2) ** 2).sum(axis=1)
    spread = scatter.deviation * np.sqrt(scatter.together * common + (1 - scatter.together) * alone)
    return Approximation(np.array([p.Omega for p in points]) / (2 * np.pi), mean, S, spread)


def sensitivities(asked: Asked, scatter: Scatter, point: Point) -> tuple[float, Array]:
    """Amplitude of the tuned ring at a solution (m), and (sectors, modes) how blade 0's changes by the relative
    deviations of another one, at one frequency: a solution for each mode of blade 0."""
    problem = asked.problem(asked.tuned.whole)
    at = problem.at(point.Omega)
    force, slopes = at.forces(point.x)
    q = at.modal(point.x, force)
    y = read(at, q[1], force, problem.share)
    matrix, modes = at.jacobian(slopes), asked.tuned.modes(scatter)
    out = np.empty((asked.tuned.sectors, modes))
    for j in range(modes):
        by, moved = _forced(at, asked.tuned, scatter, j, q)
        dx = matrix.solve(-by)
        dforce = at.along(
            [np.einsum("nkwlz,nlz->nkw", S, d) for S, d in zip(slopes, _relative(at, dx), strict=True)], preload=False
        )
        dq = _moved(at, dx, dforce)
        dq[moved[0]] = dq[moved[0]] + moved[1]
        dy = read(at, dq, dforce, 0.0)
        change = (np.conj(y) * dy).real / np.abs(y)
        out[:, j] = np.roll(change[::-1], 1)  # of blade 0 by blade i is that of blade -i by blade 0
    return float(np.abs(y[0])), out


def _relative(at: AtFrequency, dx: Array) -> list[Array]:
    """Of every group of contacts (n, k, W) changes of the displacements."""
    v = at.problem.displacement(dx)
    return [g.relative(v) - g.relative(0 * v) for g in at.problem.groups]


def _moved(at: AtFrequency, dx: Array, dforce: Array) -> list[ComplexArray]:
    """Of every part (m,) change of the first harmonic of its coordinates, by those of unknowns and (W, c) forces."""
    p = at.problem
    g = np.array(at.amplitudes(dforce - _held(at, dx)))
    each = zip(p.eliminated, p.slices, strict=True)
    return [one.coordinates(at.Omega, 0.0, g[:, s])[1] for one, s in each]


def _held(at: AtFrequency, dx: Array) -> Array:
    """(W, c) what the stiffness taken into the parts makes of a change of the unknowns."""
    p, v = at.problem, at.problem.displacement(dx)
    return np.hstack([v[:, s] @ k.T for s, k in zip(p.slices, p.stiffness, strict=True)])


def _forced(
    at: AtFrequency, tuned: Tuned, scatter: Scatter, mode: int, q: list[list[ComplexArray]]
) -> tuple[Array, tuple[int, ComplexArray]]:
    """(size,) R_p of one mode of blade 0, and the change of its coordinates in the first harmonic besides."""
    p = at.problem
    body = next(i for i, m in enumerate(p.assembly.components) if m.name == f"{tuned.body(scatter).name}_0")
    own = np.zeros(tuned.modes(scatter))
    own[mode] = STEP
    more, less = (deviated(p.assembly.components[body], scatter, sign * own) for sign in (1.0, -1.0))
    by, changed = np.zeros((p.coefficients, p.count)), np.zeros(0, dtype=complex)
    for h in range(p.harmonics + 1):
        part, k, s, w = p.parts[h][body], p.stiffness[body], p.slices[body], h * at.Omega
        index = p.assembly.index(h)
        (M1, K1, C1), (M0, K0, C0) = more.at(index).matrices, less.at(index).matrices
        H1, H0 = more.at(index).loss, less.at(index).loss
        H = H1 - H0 if h and H1 is not None and H0 is not None else 0.0
        dS = ((K1 - K0 + 1j * H) - w**2 * (M1 - M0) + 1j * w * (C1 - C0)) / (2 * STEP)
        P = np.linalg.inv(np.eye(part.count) + part.yielding @ k)
        T = part.rows
        A = part.stiff - w**2 * part.M + 1j * w * part.C + T.conj().T @ k @ P @ T
        dq = -np.linalg.solve(A, dS @ q[h][body])
        d = -P @ (T @ dq)
        if h:
            by[2 * h - 1, s], by[2 * h, s] = d.real, -d.imag
        else:
            by[0, s] = d.real
        if h == 1:
            changed = dq
    return (by / p.scale).ravel(), (body, changed)


STEP = 1e-4
"""Relative deviation over which the matrices, of second degree in it, are compared: without error but rounding."""
