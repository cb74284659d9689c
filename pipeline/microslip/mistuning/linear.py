"""A linear ring beside the one with friction, which tells in a millisecond or two which samples are likely to be high.

Its contacts have the stiffness and the damping with which those of the tuned ring, at its peak, answer to small changes
of their motion, as a mean over its phase: of a tangent dF = S du in the cosine and the sine of the first harmonic

    k = (S_cc + S_ss) / 2 + i (S_cs - S_sc) / 2

At its peak, whatever the frequency: a mistuned ring is highest elsewhere, and there its contacts slide about as far as
those of the tuned one at its own peak, not as little as the tuned one's do beside it.

Blades' modes that deviate by s = ds/dp p are added by the columns P = M V of the modes alone:

    (A + P s P^H) q = f,   eta = P^H q:   (D + s) eta = D eta_0,   y = y_0 + R (eta - eta_0)
    D = (P^H A^-1 P)^-1,   R = O A^-1 P D

D, D eta_0, R and y_0 - R eta_0 hold no resonance of these modes, and are straight lines over the square of the
frequency between those that are asked for. So a sample is known at any frequency, and where it resonates by the
eigenvalues of D + s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray
from ..errors import UserError
from ..harmonic_balance.problem import AtFrequency
from ..harmonic_balance.reduced import own_coordinates, taken_in
from ..system.assembly import Linear
from .peaks import TOLERANCE, highest, told_by
from .ring import Deviations, Tuned
from .samples import Asked, SlidingRing
from .scatter import MODAL, Scatter
from .sensitivity import number, softening

LEAST = 0.02
"""Share of the strongest mode's sensitivity, at any frequency, below which deviations of a mode are left out."""

ROUNDS = 20
"""Points looked at where parabolas tell more than is known, at most."""


@dataclass(frozen=True, eq=False)
class Beside:
    """The linear ring of a mistuned one. Of f frequencies, n columns of modes, w sectors.

    Attributes: square: (f,) omega^2, rising. modes: of every column the scatter's number, sector and mode. rise: (f, n)
        ds/dp. stiff: (f, n, n) D. push: (f, n) D eta_0. read: (f, w, n) R. rest: (f, w) y_0 - R eta_0.
    """

    square: Array
    modes: tuple[tuple[int, int, int], ...]
    rise: ComplexArray
    stiff: ComplexArray
    push: ComplexArray
    read: ComplexArray
    rest: ComplexArray

    def __call__(self, deviations: Deviations) -> float:
        """The highest amplitude of a sample in the band, m."""
        own = self.own(deviations)
        square = np.unique([*self.square, *self.resonances(own)])
        y = self.amplitudes(square, own)
        heights, top = dict(zip(square, y, strict=True)), float(y.max())
        for _ in range(ROUNDS):
            parabola = told_by(heights)
            if parabola is None or parabola[0] <= (1 + TOLERANCE) * top:
                break
            heights[parabola[1]] = self.amplitudes(np.array([parabola[1]]), own)[0]
            top = max(top, float(heights[parabola[1]].max()))
        return top

    def own(self, deviations: Deviations) -> Array:
        """(n,) deviations of the columns."""
        return np.array([deviations[i][1][sector, mode] for i, sector, mode in self.modes])

    def amplitudes(self, square: Array, own: Array) -> Array:
        """(p, w) m, at p squares of circular frequencies in the band."""
        left = np.clip(np.searchsorted(self.square, square) - 1, 0, max(len(self.square) - 2, 0))
        right = np.minimum(left + 1, len(self.square) - 1)
        apart = np.where(right > left, self.square[right] - self.square[left], 1.0)
        share = (square - self.square[left]) / apart

        def between(x: ComplexArray) -> ComplexArray:
            return x[left] + share.reshape(-1, *[1] * (x.ndim - 1)) * (x[right] - x[left])

        stiff, each = between(self.stiff), np.arange(len(own))
        stiff[:, each, each] += between(self.rise) * own
        eta = np.linalg.solve(stiff, between(self.push)[..., None])
        return np.abs(between(self.rest) + (between(self.read) @ eta)[..., 0])

    def resonances(self, own: Array) -> Array:
        """Squares of circular frequencies in the band at which D + s, a straight line over the band, is singular."""
        start, turn = self._pencil
        found = np.linalg.eigvals(start + turn * (self.rise[len(self.rise) // 2] * own)).real
        low, high = self.square[0], self.square[-1]
        return found[(found > low) & (found < high)]

    @cached_property
    def _pencil(self) -> tuple[ComplexArray, ComplexArray]:
        """(n, n) B and T, of which B + T s has the squares of the circular frequencies as eigenvalues."""
        n = self.stiff.shape[1]
        if len(self.square) < 2:
            return np.zeros((n, n), complex), np.zeros((n, n), complex)
        turn = np.linalg.inv((self.stiff[0] - self.stiff[-1]) / (self.square[-1] - self.square[0]))
        return self.square[0] * np.eye(n) + turn @ self.stiff[0], turn


def beside(asked: Asked) -> Beside:
    """The linear ring of what is asked.

    Raises:
        UserError: blades whose modes do not scatter: the linear ring would be the tuned one in every sample.
    """
    scatter = known_of(asked)
    whole, found = asked.tuned.whole, list[tuple[ComplexArray, ...]]()
    problem = asked.problem(whole)
    one = held(whole.joined(1), whole.stiffness if asked.stuck else _at_peak(asked))
    modes, P = _columns(asked.tuned, scatter, len(one.M))
    hertz = np.unique(asked.frequency)
    for f in hertz:
        at = problem.at(2 * np.pi * f)
        w = at.Omega
        X = np.linalg.solve(one.stiff - w**2 * one.M + 1j * w * one.C, np.column_stack([one.load, P]))
        by = {(j, m): _rise(at, asked.tuned, asked.scatter[j], m) for j, sector, m in modes if not sector}
        rise = np.array([by[j, mode] for j, _, mode in modes])
        q, Z = X[:, 0], X[:, 1:]
        found.append((rise, P.T @ Z, one.output @ Z, P.T @ q, one.output @ q + one.output_given))
    rise, G, Y, eta, y = (np.array(one) for one in zip(*found, strict=True))
    size = np.abs(Y * (rise * eta)[:, None]).max(axis=(0, 1))
    strong = {(i, mode) for (i, _, mode), a in zip(modes, size, strict=True) if a > LEAST * size.max()}
    kept = [n for n, (i, _, mode) in enumerate(modes) if (i, mode) in strong]
    rise, Y, eta, stiff = rise[:, kept], Y[:, :, kept], eta[:, kept, None], np.linalg.inv(G[:, kept][:, :, kept])
    read = Y @ stiff
    push, rest = (stiff @ eta)[..., 0], y - (read @ eta)[..., 0]
    return Beside((2 * np.pi * hertz) ** 2, tuple(modes[n] for n in kept), rise, stiff, push, read, rest)


def _at_peak(asked: Asked) -> ComplexArray:
    """(relative, relative) k of the contacts of the tuned ring at its peak."""
    respond = SlidingRing(asked.problem(asked.tuned.whole), asked.tuned_points)
    top = highest(respond, asked.frequency, follow=respond.follow, at_once=respond.at_once)
    point = respond.known[top.frequency]
    at = respond.problem.at(point.Omega)
    return answer(at, at.forces(point.x)[1])


def known_of(asked: Asked) -> list[tuple[int, Scatter]]:
    """Numbers and scatters that the linear ring knows of.

    Raises:
        UserError: none.
    """
    scattered = [(i, s) for i, s in enumerate(asked.scatter) if s.of in MODAL and asked.tuned.body(s).sectors == 1]
    if not scattered:
        raise UserError("rare: needs blades whose frequency or damping scatters, for the linear ring to tell samples")
    return scattered


def held(part: Linear, k: Array) -> Linear:
    """A part with contacts of a stiffness (c, c), which may be complex, taken into it."""
    T = part.rows
    _, _, stiff, K = taken_in(part, k)
    return replace(
        part, K=K, loss=None, load=part.load - T.T @ (stiff @ part.given),
        output=part.output - part.output_residual @ (stiff @ T),
        output_given=part.output_given - part.output_residual @ (stiff @ part.given),
    )  # fmt: skip


def _columns(tuned: Tuned, scatter: list[tuple[int, Scatter]], size: int) -> tuple[list[tuple[int, int, int]], Array]:
    """Of every scattered mode its number, sector and mode, and (size, n) M V of it in the ring's coordinates."""
    own = own_coordinates(tuned.whole, 0)
    places = {m.name: s for m, s in zip(tuned.whole.components, own, strict=True)}
    modes, columns = [], []
    for i, s in scatter:
        group = tuned.body(s).groups[0]
        P = group.M_r if group.to_diagonal is None else group.M_r @ group.to_diagonal
        for sector in range(tuned.sectors):
            for mode in range(P.shape[1]):
                columns.append(np.zeros(size))
                columns[-1][places[f"{tuned.body(s).name}_{sector}"]] = P[:, mode]
                modes.append((i, sector, mode))
    return modes, np.array(columns).T


def _rise(at: AtFrequency, tuned: Tuned, s: Scatter, mode: int) -> complex:
    """ds/dp of a mode by its deviation."""
    group, body = tuned.body(s).groups[0], number(at.problem, tuned, s, 0)
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    return complex(V[:, mode] @ softening(at, body, s, mode, 1) @ V[:, mode])


def answer(at: AtFrequency, slopes: list[Array]) -> ComplexArray:
    """(relative, relative) k of all contacts, from the derivatives of their forces."""
    stiffness = {}
    for g, S in zip(at.problem.groups, slopes, strict=True):
        for i, one in zip(g.contacts, S, strict=True):
            cc, ss, cs, sc = one[:, 1, :, 1], one[:, 2, :, 2], one[:, 1, :, 2], one[:, 2, :, 1]
            stiffness[i] = 0.5 * (cc + ss + 1j * (cs - sc))
    return np.asarray(scipy.linalg.block_diag(*(stiffness[i] for i in sorted(stiffness))))
