"""How blades answer to small deviations: Sextro's approximation of a mistuned ring from its tuned solution (5.6).

With friction the stiffness of the contacts depends on the motion, so that the derivative is that of the balance
R(x, p) = 0 (for one that does not, Eq. (5.6-3) is the same):

    dy/dp = y_p - y_x (dR/dx)^-1 R_p

From the left, y_x (dR/dx)^-1 is one solution of the transposed equations, and holds what one blade gains by any
deviation. By the symmetry of the tuned ring the other blades gain as much by those of blades as far away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..data import Array, ComplexArray
from ..harmonic_balance.blocks import Matrix
from ..harmonic_balance.problem import AtFrequency, Problem
from ..harmonic_balance.reduced import own_coordinates, taken_in
from ..harmonic_balance.solver import Point
from .ring import Tuned, deviated
from .samples import Asked, read
from .scatter import MODAL, Scatter
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
    each = [sensitivities(asked, scatter, point) for point in points]
    mean, S = np.array([m for m, _ in each]), np.array([s for _, s in each])
    return Approximation(np.array([p.Omega for p in points]) / (2 * np.pi), mean, S, spread(S, scatter))


def spread(S: Array, scatter: Scatter) -> Array:
    """(f,) standard deviation of what is linear in the deviations: its (f, sectors, modes) sensitivities S in waves
    round the ring, of which each has its own share of correlated deviations."""
    power = scatter.power(S.shape[1])
    alone = (np.abs(np.fft.fft(S, axis=1, norm="ortho")) ** 2).sum(axis=2) @ power
    common = np.abs(np.fft.fft(S.sum(axis=2), axis=1, norm="ortho")) ** 2 @ power
    return np.asarray(scatter.deviation * np.sqrt(scatter.together * common + (1 - scatter.together) * alone))


def sensitivities(asked: Asked, scatter: Scatter, point: Point) -> tuple[float, Array]:
    """Amplitude of blade 0 of the tuned ring at a solution (m), and (sectors, modes) how it changes by the relative
    deviations of every blade, at one frequency: one solution of the transposed equations."""
    now, modes = LinearisedRing.of(asked.problem(asked.tuned.whole), point), asked.tuned.modes(scatter)
    p, pushed = now.at.problem, now.pushes()
    out = np.zeros((asked.tuned.sectors, modes))
    bodies = [number(p, asked.tuned, scatter, j) for j in range(asked.tuned.sectors)]
    where = [_where(p, body) for body in bodies]
    for h in range(p.harmonics + 1):
        for mode in range(modes):
            dS = softening(now.at, bodies[0], scatter, mode, h)
            out[:, mode] += [(pushed[h][i][own] @ (dS @ now.q[h][i][own])).real for i, own in where]
    return float(np.abs(now.y[0])), out


@dataclass(frozen=True, eq=False)
class LinearisedRing:
    """A ring about its motion at one frequency.

    Attributes: at. force: (W, c) of the contacts. slopes: its derivatives, of each group. q: harmonic -> part -> its
        coordinates. y: (w,) read-outs.
    """

    at: AtFrequency
    force: Array
    slopes: list[Array]
    q: list[list[ComplexArray]]
    y: ComplexArray

    @classmethod
    def of(cls, problem: Problem, point: Point) -> LinearisedRing:
        at = problem.at(point.Omega)
        force, slopes = at.forces(point.x)
        q = at.modal(point.x, force)
        return cls(at, force, slopes, q, read(at, q[1], force, at.problem.share))

    @cached_property
    def matrix(self) -> Matrix:
        return self.at.jacobian(self.slopes)

    def felt(self, v: Array, turned: bool = False) -> Array:
        """(W, c) E^T S E v, or that of the transposed S: changes of the forces by (W, c) v of the coordinates."""
        groups = self.at.problem.groups
        along = "nlzkw,nlz->nkw" if turned else "nkwlz,nlz->nkw"
        each = zip(groups, self.slopes, strict=True)
        moved = [np.einsum(along, S, g.relative(v) - g.relative(0 * v)) for g, S in each]
        return self.at.along(moved, preload=False)

    def pushes(self) -> list[list[ComplexArray]]:
        """Harmonic -> part -> (m,) z: the real part of z . S q is how much amplitude the first read-out gains where a
        part's dynamic stiffness grows by S."""
        p, u = self.at.problem, np.conj(self.y[0]) / np.abs(self.y[0])
        by_force, by_motion = np.zeros((2, p.coefficients, p.count))
        own = {}
        for i, (part, k, s) in enumerate(zip(p.parts[1], p.stiffness, p.slices, strict=True)):
            A, rows = self._of_part(i, 1)
            own[i] = u * np.linalg.solve(A.T, part.output[0])
            moved = own[i] @ part.rows.conj().T @ taken_in(part, k)[1]
            for out, z in ((by_force, moved + u * part.output_residual[0]), (by_motion, moved @ k)):
                out[1, s], out[2, s] = -z.real, -z.imag
        c = self.felt(by_force, turned=True) - by_motion
        turned = self.matrix.transposed.solve((c * p.scale).ravel()).reshape(c.shape) / p.scale
        pushes: list[list[ComplexArray]] = []
        for h in range(p.harmonics + 1):
            z = turned[0] if h == 0 else turned[2 * h - 1] + 1j * turned[2 * h]
            each = [(*self._of_part(i, h), s) for i, s in enumerate(p.slices)]
            pushes.append([np.asarray(-np.linalg.solve(A.T, z[s] @ rows), complex) for A, rows, s in each])
        pushes[1] = [z - own[i] for i, z in enumerate(pushes[1])]
        return pushes

    def _of_part(self, i: int, h: int) -> tuple[ComplexArray, ComplexArray]:
        """A part's dynamic stiffness with contacts of the stiffness taken into it, and what of it they feel."""
        p, w = self.at.problem, h * self.at.Omega
        part, k = p.parts[h][i], p.stiffness[i]
        P, T = taken_in(part, k)[0], part.rows
        A = part.stiff - w**2 * part.M + 1j * w * part.C + T.conj().T @ k @ P @ T
        return A.astype(complex), P @ T


def number(p: Problem, tuned: Tuned, scatter: Scatter, sector: int) -> int:
    """Of a sector's body among the parts."""
    name = f"{tuned.body(scatter).name}_{sector}"
    return next(i for i, m in enumerate(p.assembly.components) if m.name == name)


def _where(p: Problem, body: int) -> tuple[int, slice]:
    """Number of the part that a body is eliminated in, and its coordinates there."""
    if len(p.slices) > 1:
        return body, slice(None)
    return 0, own_coordinates(p.assembly, 0)[body]


def softening(at: AtFrequency, body: int, scatter: Scatter, mode: int, h: int) -> ComplexArray:
    """(m, m) derivative of a body's dynamic stiffness in a harmonic by the relative deviation of one mode."""
    component, w = at.problem.assembly.components[body], h * at.Omega
    own = np.zeros(max(mode + 1, len(component.groups[0].omega)) if scatter.of in MODAL else 1)
    own[mode] = STEP
    index = at.problem.assembly.index(h)
    more, less = (deviated(component, scatter, sign * own).at(index) for sign in (1.0, -1.0))
    (M1, K1, C1), (M0, K0, C0) = more.matrices, less.matrices
    H = more.loss - less.loss if h and more.loss is not None and less.loss is not None else 0.0
    return ((K1 - K0 + 1j * H) - w**2 * (M1 - M0) + 1j * w * (C1 - C0)) / (2 * STEP)


STEP = 1e-4
"""Relative deviation over which the matrices, of second degree in it, are compared: without error but rounding."""
