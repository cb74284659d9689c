"""Newton steps of many bodies by the relative motions of their contacts, whose number is half that of the sides.

With the motions v of both sides of every contact (`problem.Problem`, form ``sides``) a step is

    dv + D (E^T S E dv - k dv) = -R,    d = E v

where S, the derivative of the forces, and k feel few of the coordinates: three of a patch with one point. Of these
alone, and with A = 1 - D k of each body by itself,

    dv = -A^-1 R - A^-1 D E^T S dd,    (1 + E A^-1 D E^T S) dd = -E A^-1 R

and what they tell of the forces moves the others. A is what the body does without contacts, and singular where that is
at resonance without damping: then the sides are solved for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..data import Array, ComplexArray, Indices, largest
from .blocks import DenseMatrix, Matrix, around

LEFT = 1e-6
"""Share of the right side that a step may leave: of Newton's method, which sees the rest in the next one."""


@dataclass(frozen=True, eq=False)
class Sides:
    """The m sides of n contacts, of k coordinates at most that the contacts feel.

    Attributes:
        contact, part: (m,) numbers of theirs. sign: (m,) 1 of a first side, -1 of a second one. at: (m, k) their
            coordinates, `count` where there are fewer. count: of all coordinates.
    """

    contact: Indices
    part: Indices
    sign: Array
    at: Indices
    count: int

    @cached_property
    def of_contacts(self) -> tuple[Indices, Indices]:
        """(n,) first and second sides, m where there is none."""
        found = np.full((2, self.contact.max(initial=-1) + 1), len(self.contact))
        found[(self.sign < 0).astype(int), self.contact] = np.arange(len(self.contact))
        return found[0], found[1]

    def of_parts(self, parts: Indices) -> Indices:
        """(p, r) sides of each of some parts, m where there are fewer than r."""
        each = [np.flatnonzero(self.part == i) for i in parts]
        out = np.full((len(each), max(map(len, each), default=0)), len(self.part))
        for row, sides in zip(out, each, strict=True):
            row[: len(sides)] = sides
        return out

    @cached_property
    def met(self) -> tuple[Indices, Indices, Indices]:
        """(2, q) sides of one part, each with each, ordered by the contacts of both; (u,) where those of the same two
        contacts begin, and (2, u) these."""
        pairs = np.array(np.nonzero(self.part[:, None] == self.part))
        i, j = self.contact[pairs]
        pairs = pairs[:, np.lexsort((j, i))]
        contacts = self.contact[pairs]
        begins = np.flatnonzero(np.append(True, (np.diff(contacts) != 0).any(axis=0))[: pairs.shape[1]])
        return pairs, begins, contacts[:, begins]

    @cached_property
    def ring(self) -> RingOfGaps | None:
        """The smallest gaps that the contacts are those of, so many each, of which each meets the one behind and the
        one before alone; None where others meet."""
        (i, j), n = self.met[2], len(self.of_contacts[0])
        for each in range(1, n // 3 + 1):
            count, number = n // each, np.arange(n)
            for gap, place in ((number // each, number % each), (number % count, number // count)):
                away = (gap[j] - gap[i]) % count
                whole = n % each == 0 and (count > 3 or each == 1)  # of three gaps each meets all
                if whole and np.isin(away, (0, 1, count - 1)).all():
                    return RingOfGaps(gap, place, np.where(away == count - 1, 2, away), count, each)
        return None


@dataclass(frozen=True, eq=False)
class RingOfGaps:
    """Contacts in the gaps of a ring.

    Attributes:
        gap, place: (n,) of each contact, and its number there. away: (u,) of two contacts that meet, whether the second
            is in the gap of the first (0), in the one behind (1) or before (2). count: of gaps. each: contacts of one.
    """

    gap: Indices
    place: Indices
    away: Indices
    count: int
    each: int

    def solved(self, i: Indices, j: Indices, blocks: Array, right: Array) -> Array:
        """(n, s) d of the matrix whose (u, s, s) blocks stand at the contacts i, j that meet, and (n, s)."""
        s, r = right.shape[1], np.empty((self.count, self.each, right.shape[1]))
        A = np.zeros((3, self.count, self.each, s, self.each, s))
        A[self.away, self.gap[i], self.place[i], :, self.place[j]] = blocks
        r[self.gap, self.place] = right
        D, behind, before = A.reshape(3, self.count, self.each * s, self.each * s)
        return around(D, behind, before, r.reshape(self.count, -1)).reshape(r.shape)[self.gap, self.place]


@dataclass(frozen=True, eq=False)
class Parts:
    """The sides of p parts with as many coordinates.

    Attributes:
        numbers: (p,) rising. at: (p, c) their coordinates among all. sides: (p, r) see `Sides.of_parts`. own: (p, r k)
            what contacts feel of the coordinates, c where there are fewer. stiffness: (p, r k, r k) what of that of
            the contacts is taken into them. met: (4, v) numbers among the pairs of `Sides.met`, of the part here, and
            of both sides among its own.
    """

    numbers: Indices
    at: Indices
    sides: Indices
    own: Indices
    stiffness: Array
    met: Indices

    @classmethod
    def of(cls, numbers: Indices, at: Indices, sides: Sides, stiffness: Array) -> Parts:
        """stiffness: (p, c, c)."""
        (p, c), found = at.shape, sides.of_parts(numbers)
        among = np.vstack([sides.at, np.full((1, sides.at.shape[1]), sides.count)])[found]
        own = np.where(among < sides.count, among - at[:, :1, None], c).reshape(p, found.shape[1] * among.shape[2])
        wide = np.pad(stiffness, ((0, 0), (0, 1), (0, 1)))
        held = wide[np.arange(p)[:, None, None], own[:, :, None], own[:, None, :]]
        (one, other), place = sides.met[0], np.zeros((2, len(sides.part) + 1), int)
        place[0, found], place[1, found] = np.arange(p)[:, None], np.arange(found.shape[1])
        met = np.flatnonzero(np.isin(sides.part[one], numbers))
        return cls(numbers, at, found, own, held, np.array([met, *place[:, one[met]], place[1, other[met]]]))

    def felt(self, v: Array) -> Array:
        """(p, W, r k) of (m, W, k) of all sides."""
        wide = np.concatenate([v, np.zeros((1, *v.shape[1:]))])[self.sides]
        return wide.swapaxes(1, 2).reshape(len(wide), v.shape[1], self.own.shape[1])


@dataclass(frozen=True, eq=False)
class Alone:
    """What parts with as many coordinates do without contacts.

    Attributes:
        parts. compliance: (p, H + 1, c, r k) D from what contacts feel to all coordinates. inverse, loose: (p, H + 1,
            r k, r k) A^-1 and A^-1 D of what contacts feel.
    """

    parts: Parts
    compliance: ComplexArray
    inverse: ComplexArray
    loose: ComplexArray


@dataclass(frozen=True, eq=False)
class Apart:
    """All parts without contacts, at one frequency.

    Attributes: each. sides. between: (u, W k, W k) E A^-1 D E^T, by the pairs of contacts of `Sides.met`.
    """

    each: list[Alone]
    sides: Sides
    between: Array

    def step(self, R: Array, S: Array) -> Array | None:
        """(W, c) dv of (W, c) dv + D (E^T S E - k) dv = R; None where it is not found this way."""
        s = self.sides
        free = self._made(np.vstack([R.T, np.zeros((1, len(R)))])[s.at].swapaxes(1, 2), "inverse")
        d = self._relative(free)
        force = _across(S, self._solved(S, d.reshape(len(d), -1)).reshape(d.shape))
        given = s.sign[:, None, None] * force[s.contact]
        moved = free - self._made(given, "loose")
        off = force - _across(S, self._relative(moved))
        if not largest(off) <= LEFT * largest(force):
            return None
        out = R.copy()
        for one in self.each:
            p = one.parts
            beyond = p.felt(given) - p.felt(moved) @ p.stiffness.swapaxes(1, 2)
            out[:, p.at] -= applied(one.compliance, beyond[..., None])[..., 0].swapaxes(0, 1)
        return out

    def _made(self, v: Array, by: str) -> Array:
        """(m, W, k) what one of the matrices of `Alone` makes of (m, W, k) of the sides."""
        out = np.empty((len(v) + 1, *v.shape[1:]))
        for one in self.each:
            p, r = one.parts.sides.shape
            found = applied(getattr(one, by), one.parts.felt(v)[..., None])
            out[one.parts.sides] = found.reshape(p, v.shape[1], r, v.shape[2]).swapaxes(1, 2)
        return out[:-1]

    def _relative(self, v: Array) -> Array:
        """(n, W, k) E of what (m, W, k) sides move by."""
        wide = np.concatenate([v, np.zeros((1, *v.shape[1:]))])
        first, second = self.sides.of_contacts
        return wide[first] - wide[second]

    def _solved(self, S: Array, right: Array) -> Array:
        """(n, W k) d of (1 + E A^-1 D E^T S) d = right."""
        (n, s), (i, j), ring = right.shape, self.sides.met[2], self.sides.ring
        blocks = self.between @ S[j]
        blocks[i == j] += np.eye(s)
        if ring is not None:
            return ring.solved(i, j, blocks, right)
        A = np.zeros((n, s, n, s))
        A[i, :, j] = blocks
        return DenseMatrix(A.reshape(n * s, n * s)).solve(right.ravel()).reshape(n, s)


def apart(sides: Sides, each: list[tuple[Parts, ComplexArray]]) -> Apart | None:
    """All parts without contacts, of their D (p, H + 1, c, c); None where one is at resonance there."""
    found = list[Alone]()
    pairs, begins, _ = sides.met
    k, harmonics = sides.at.shape[1], each[0][1].shape[1]
    met = np.empty((pairs.shape[1], harmonics, k, k), complex)
    for parts, D in each:
        (p, f), r = parts.own.shape, parts.sides.shape[1]
        wide, of = np.pad(D, ((0, 0), (0, 0), (0, 1), (0, 1))), np.arange(p)[:, None]
        compliance = wide[of, :, :, parts.own].transpose(0, 2, 3, 1)
        felt = compliance[of, :, parts.own].transpose(0, 2, 1, 3)
        try:
            inverse = np.linalg.inv(np.eye(f) - felt @ parts.stiffness[:, None]).astype(complex)
        except np.linalg.LinAlgError:
            return None
        loose = inverse @ felt
        found.append(Alone(parts, compliance[:, :, :-1], inverse, loose))
        own, i, a, b = parts.met
        met[own] = loose.reshape(p, harmonics, r, k, r, k)[i, :, a, :, b]
    met *= np.prod(sides.sign[pairs], axis=0)[:, None, None, None]
    return Apart(found, sides, _of_coefficients(np.add.reduceat(met, begins)))


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


def _across(S: Array, d: Array) -> Array:
    """(n, W, k) forces S d."""
    return (S @ d.reshape(len(d), -1, 1)).reshape(d.shape)


@dataclass(frozen=True, eq=False)
class Joints:
    """1 + D (E^T S E - k), see above.

    Attributes:
        apart: None where there is no such thing. slopes: (n, W k, W k) S of the contacts. scale: (c,) of a unit of x.
        blocks: the same matrix, of the sides.
    """

    apart: Apart | None
    slopes: Array
    scale: Array
    blocks: Callable[[], Matrix]

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
        if self.apart is not None:
            with np.errstate(all="ignore"):
                dv = self.apart.step(right.reshape(-1, len(self.scale)) * self.scale, self.slopes)
            if dv is not None and np.isfinite(dv).all():
                return (dv / self.scale).ravel()
        return self._of_sides.solve(right)


def applied(D: ComplexArray, V: Array) -> Array:
    """(..., W, c, m) matrices (..., H + 1, c, k) of the harmonics applied to (..., W, k, m)."""
    out = np.empty((*D.shape[:-3], V.shape[-3], D.shape[-2], V.shape[-1]))
    out[..., 0, :, :] = D[..., 0, :, :].real @ V[..., 0, :, :]
    amplitude = D[..., 1:, :, :] @ (V[..., 1::2, :, :] - 1j * V[..., 2::2, :, :])
    out[..., 1::2, :, :], out[..., 2::2, :, :] = amplitude.real, -amplitude.imag
    return out
