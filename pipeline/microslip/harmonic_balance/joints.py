"""Newton steps of many bodies by the relative motions of their contacts, whose number is half that of the sides.

With the motions v of both sides of every contact (`problem.Problem`, form ``sides``) a step is

    dv + D (E^T S E dv - k dv) = -R,    d = E v

where S, the derivative of the forces, feels the relative motions d alone. With A = 1 - D k of each body by itself

    dv = -A^-1 R - A^-1 D E^T S dd,    (1 + E A^-1 D E^T S) dd = -E A^-1 R

and of d only what S feels: three coordinates of a patch with one point. A is what the body does without contacts, and
singular where that is at resonance without damping: then the sides are solved for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..data import Array, ComplexArray, Indices
from .blocks import Matrix, one_plus

LEFT = 1e-6
"""Share of the right side that a step may leave: of Newton's method, which sees the rest in the next one."""


@dataclass(frozen=True, eq=False)
class Sides:
    """The m sides of n contacts, of k coordinates at most that the contacts feel.

    Attributes:
        contact, part: (m,) numbers of theirs. sign: (m,). at: (m, k) their coordinates among all, whose number where
            there are fewer. own: (m, k) the same among those of the part, -1 where there are fewer.
    """

    contact: Indices
    part: Indices
    sign: Array
    at: Indices
    own: Indices

    def pairs(self, parts: Indices) -> tuple[Indices, Indices]:
        """(2, q) sides of one of the parts, each with each, and (q,) which of the parts."""
        one, other = np.nonzero((self.part[:, None] == self.part) & np.isin(self.part, parts)[:, None])
        return np.array([one, other]), np.searchsorted(parts, self.part[one])


@dataclass(frozen=True, eq=False)
class Alone:
    """What p parts with as many coordinates do without contacts.

    Attributes:
        places: (p, c) their coordinates among all. inverse, loose: (p, H + 1, c, c) A^-1 and A^-1 D. pairs: (2, q) see
            `Sides`. between: (q, W k, W k) `loose` from forces on the second of a pair to motions of the first.
    """

    places: Indices
    inverse: ComplexArray
    loose: ComplexArray
    pairs: Indices
    between: Array


def alone(places: Indices, parts: Indices, D: ComplexArray, k: Array, sides: Sides) -> Alone | None:
    """What parts do without contacts; None where one is at resonance there.

    Args:
        places: (p, c), see `Alone`. parts: (p,) numbers, rising. D: (p, H + 1, c, c). k: (p, c, c).
    """
    try:
        inverse = np.linalg.inv(np.eye(k.shape[-1]) - D @ k[:, None]).astype(complex)
    except np.linalg.LinAlgError:
        return None
    loose, (pairs, which) = inverse @ D, sides.pairs(parts)
    own = sides.own[pairs]
    rows, columns = own[0][:, None, :, None], own[1][:, None, None, :]
    wide = np.pad(loose, ((0, 0), (0, 0), (0, 1), (0, 1)))
    met = wide[which[:, None, None, None], np.arange(D.shape[1])[:, None, None], rows, columns]
    return Alone(places, inverse, loose, pairs, _of_coefficients(met))


def _of_coefficients(M: ComplexArray) -> Array:
    """(q, W k, W k) real matrices of (q, H + 1, k, k) those of the harmonics."""
    q, H, k, _ = M.shape
    out = np.zeros((q, 2 * H - 1, k, 2 * H - 1, k))
    out[:, 0, :, 0] = M[:, 0].real
    for h in range(1, H):
        cos, sin = 2 * h - 1, 2 * h
        out[:, cos, :, cos] = out[:, sin, :, sin] = M[:, h].real
        out[:, cos, :, sin], out[:, sin, :, cos] = M[:, h].imag, -M[:, h].imag
    return out.reshape(q, (2 * H - 1) * k, (2 * H - 1) * k)


@dataclass(frozen=True, eq=False)
class Joints:
    """1 + D (E^T S E - k), see above.

    Attributes:
        alone: of all parts, see `alone`; None: of one there is nothing. slopes: (n, k, W, k, W) S of the contacts.
        sides: theirs. scale: (c,) of a unit of x. blocks: the same matrix, of the sides.
    """

    alone: list[Alone] | None
    slopes: Array
    sides: Sides
    scale: Array
    blocks: Callable[[], Matrix]

    @property
    def coefficients(self) -> int:
        return self.slopes.shape[2]

    def dense(self) -> Array:
        return self._of_sides.dense()

    @property
    def transposed(self) -> Matrix:
        return self._of_sides.transposed

    @cached_property
    def _of_sides(self) -> Matrix:
        return self.blocks()

    def solve(self, right: Array) -> Array:
        """See `blocks.Matrix`."""
        R = right.reshape(self.coefficients, -1) * self.scale
        with np.errstate(all="ignore"):
            dv = self._step(R)
        if dv is None or not np.isfinite(dv).all():
            return self._of_sides.solve(right)
        return (dv / self.scale).ravel()

    def _step(self, R: Array) -> Array | None:
        """(W, c) dv of (W, c) A dv + D E^T S E dv = R; None where it is not found this way."""
        if self.alone is None:
            return None
        free = np.empty_like(R)
        for one in self.alone:
            free[:, one.places] = _applied(one.inverse, R[:, one.places])
        force = self._across(self._relative.solve(self._felt(free).ravel()))
        dv = free - self._answered(force)
        off = force - self._across(self._felt(dv))
        return dv if np.abs(off).max(initial=0.0) <= LEFT * np.abs(force).max(initial=0.0) else None

    def _felt(self, v: Array) -> Array:
        """(n, W, k) relative motions that the contacts feel, from (W, c)."""
        s = self.sides
        own = np.hstack([v, np.zeros((len(v), 1))])[:, s.at].transpose(1, 0, 2)
        out = np.zeros((len(self.slopes), *own.shape[1:]))
        np.add.at(out, s.contact, s.sign[:, None, None] * own)
        return out

    @cached_property
    def _matrices(self) -> Array:
        """(n, W k, W k) S, ordered by harmonics."""
        n, k, W, *_ = self.slopes.shape
        return self.slopes.transpose(0, 2, 1, 4, 3).reshape(n, W * k, W * k)

    def _across(self, d: Array) -> Array:
        """(n, W, k) forces S d."""
        n, k, W, *_ = self.slopes.shape
        return (self._matrices @ d.reshape(n, W * k, 1)).reshape(n, W, k)

    def _answered(self, force: Array) -> Array:
        """(W, c) A^-1 D E^T of forces."""
        s = self.sides
        given = np.zeros((self.coefficients, len(self.scale) + 1))
        given[:, s.at] = (s.sign[:, None, None] * force[s.contact]).transpose(1, 0, 2)
        out = np.empty((self.coefficients, len(self.scale)))
        for one in self.alone or []:
            out[:, one.places] = _applied(one.loose, given[:, one.places])
        return out

    @cached_property
    def _relative(self) -> Matrix:
        """1 + E A^-1 D E^T S, contact by contact."""
        pieces: dict[tuple[int, int], Array] = {}
        (n, k, W, *_), s = self.slopes.shape, self.sides
        for one in self.alone or []:
            i, j = s.contact[one.pairs]
            found = one.between @ (np.prod(s.sign[one.pairs], axis=0)[:, None, None] * self._matrices[j])
            for key, block in zip(zip(i.tolist(), j.tolist(), strict=True), found, strict=True):
                pieces[key] = pieces[key] + block if key in pieces else block
        return one_plus(pieces, [k] * n, W, by_parts=True)


def _applied(D: ComplexArray, v: Array) -> Array:
    """(W, p, c) what matrices (p, H + 1, c, c) make of (W, p, c)."""
    return applied(D, v.transpose(1, 0, 2)[..., None])[..., 0].transpose(1, 0, 2)


def applied(D: ComplexArray, V: Array) -> Array:
    """(..., W, c, m) matrices (..., H + 1, c, k) of the harmonics applied to (..., W, k, m)."""
    out = np.empty((*D.shape[:-3], V.shape[-3], D.shape[-2], V.shape[-1]))
    out[..., 0, :, :] = D[..., 0, :, :].real @ V[..., 0, :, :]
    amplitude = D[..., 1:, :, :] @ (V[..., 1::2, :, :] - 1j * V[..., 2::2, :, :])
    out[..., 1::2, :, :], out[..., 2::2, :, :] = amplitude.real, -amplitude.imag
    return out
