"""A linear ring beside the one with friction, which tells in milliseconds which samples are likely to be high.

Its contacts have the stiffness and the damping with which those of the tuned ring answer to small changes of their
motion, as a mean over its phase: of a tangent dF = S du in the cosine and the sine of the first harmonic

    k = (S_cc + S_ss) / 2 + i (S_cs - S_sc) / 2

Blades' modes that deviate by s = ds/dp p are added by the columns P = M V of the modes alone:

    (A + P s P^H) q = f,   eta = P^H q = (1 + G s)^-1 eta_0,   y = y_0 - Y s eta,   G = P^H A^-1 P,   Y = O A^-1 P
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray
from ..errors import UserError
from ..harmonic_balance.problem import AtFrequency
from ..system.assembly import Linear
from .peaks import told_by
from .ring import Deviations, Tuned
from .samples import Asked
from .scatter import MODAL, Scatter
from .sensitivity import number, softening

LEAST = 0.02
"""Share of the strongest mode's sensitivity, at any frequency, below which deviations of a mode are left out."""


@dataclass(frozen=True, eq=False)
class Beside:
    """The linear ring of a mistuned one. Of f frequencies, n columns of modes, w sectors.

    Attributes: frequency: (f,) Hz. modes: of every column the scatter's number, sector and mode. rise: (f, n) ds/dp.
        G: (f, n, n). Y: (f, w, n). eta: (f, n). y: (f, w).
    """

    frequency: Array
    modes: tuple[tuple[int, int, int], ...]
    rise: ComplexArray
    G: ComplexArray
    Y: ComplexArray
    eta: ComplexArray
    y: ComplexArray

    def __call__(self, deviations: Deviations) -> tuple[float, float]:
        """The highest amplitude of a sample, m: on the frequencies, and between them as parabolas tell."""
        own = np.array([deviations[i][1][sector, mode] for i, sector, mode in self.modes])
        s = self.rise * own
        moved = np.linalg.solve(np.eye(s.shape[1]) + self.G * s[:, None, :], self.eta[..., None])[..., 0]
        y = np.abs(self.y - np.einsum("fwn,fn->fw", self.Y, s * moved))
        told, top = told_by(dict(zip(self.frequency, y, strict=True))), float(y.max())
        return top, told[0] if told is not None and top < told[0] < np.sqrt(2) * top else top


def beside(asked: Asked) -> Beside:
    """The linear ring of what is asked.

    Raises:
        UserError: blades whose modes do not scatter: the linear ring would be the tuned one in every sample.
    """
    scatter = known_of(asked)
    whole = asked.tuned.whole
    part, found = whole.joined(1), list[tuple[ComplexArray, ...]]()
    modes, P, problem = *_columns(asked.tuned, scatter, len(part.M)), asked.problem(whole)
    hertz = asked.frequency if asked.stuck else np.array([p.Omega for p in asked.tuned_points]) / (2 * np.pi)
    for i, f in enumerate(hertz):
        at = problem.at(2 * np.pi * f)
        k = whole.stiffness if asked.stuck else answer(at, at.forces(asked.tuned_points[i].x)[1])
        one, w = held(part, k), at.Omega
        X = np.linalg.solve(one.stiff - w**2 * one.M + 1j * w * one.C, np.column_stack([one.load, P]))
        by = {(j, m): _rise(at, asked.tuned, asked.scatter[j], m) for j, sector, m in modes if not sector}
        rise = np.array([by[j, mode] for j, _, mode in modes])
        q, Z = X[:, 0], X[:, 1:]
        found.append((rise, P.T @ Z, one.output @ Z, P.T @ q, one.output @ q + one.output_given))
    rise, G, Y, eta, y = (np.array(one) for one in zip(*found, strict=True))
    size = np.abs(Y * (rise * eta)[:, None]).max(axis=(0, 1))
    strong = {(i, mode) for (i, _, mode), a in zip(modes, size, strict=True) if a > LEAST * size.max()}
    kept = [n for n, (i, _, mode) in enumerate(modes) if (i, mode) in strong]
    return Beside(
        hertz, tuple(modes[n] for n in kept), rise[:, kept], G[:, kept][:, :, kept], Y[:, :, kept], eta[:, kept], y
    )


def known_of(asked: Asked) -> list[tuple[int, Scatter]]:
    """Numbers and scatters that the linear ring knows of.

    Raises:
        UserError: none.
    """
    found = [(i, s) for i, s in enumerate(asked.scatter) if s.of in MODAL and asked.tuned.body(s).sectors == 1]
    if not found:
        raise UserError("rare: needs blades whose frequency or damping scatters, for the linear ring to tell samples")
    return found


def held(part: Linear, k: Array) -> Linear:
    """A part with contacts of a stiffness (c, c), which may be complex, taken into it."""
    T = part.rows
    stiff = k @ np.linalg.inv(np.eye(part.count) + part.yielding @ k)
    return replace(
        part, K=part.stiff + T.T @ stiff @ T, loss=None, load=part.load - T.T @ (stiff @ part.given),
        output=part.output - part.output_residual @ (stiff @ T),
        output_given=part.output_given - part.output_residual @ (stiff @ part.given),
    )  # fmt: skip


def _columns(tuned: Tuned, scatter: list[tuple[int, Scatter]], size: int) -> tuple[list[tuple[int, int, int]], Array]:
    """Of every scattered mode its number, sector and mode, and (size, n) M V of it in the ring's coordinates."""
    ends = np.cumsum([0] + [len(m.groups[0].M_r) for m in tuned.whole.components])
    begins = {m.name: int(b) for m, b in zip(tuned.whole.components, ends[:-1], strict=True)}
    modes, columns = [], []
    for i, s in scatter:
        group = tuned.body(s).groups[0]
        P = group.M_r if group.to_diagonal is None else group.M_r @ group.to_diagonal
        for sector in range(tuned.sectors):
            for mode in range(P.shape[1]):
                at = begins[f"{tuned.body(s).name}_{sector}"]
                columns.append(np.zeros(size))
                columns[-1][at : at + len(P)] = P[:, mode]
                modes.append((i, sector, mode))
    return modes, np.array(columns).T


def _rise(at: AtFrequency, tuned: Tuned, s: Scatter, mode: int) -> complex:
    """ds/dp of a mode by its deviation."""
    group, body = tuned.body(s).groups[0], number(at.problem, tuned, s, 0)
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    return complex(V[:, mode] @ softening(at, body, s, mode, 1) @ V[:, mode])


def answer(at: AtFrequency, slopes: list[Array]) -> ComplexArray:
    """(relative, relative) k of all contacts, from the derivatives of their forces."""
    found = {}
    for g, S in zip(at.problem.groups, slopes, strict=True):
        for i, one in zip(g.contacts, S, strict=True):
            cc, ss, cs, sc = one[:, 1, :, 1], one[:, 2, :, 2], one[:, 1, :, 2], one[:, 2, :, 1]
            found[i] = 0.5 * (cc + ss + 1j * (cs - sc))
    return np.asarray(scipy.linalg.block_diag(*(found[i] for i in sorted(found))))
