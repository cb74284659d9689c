"""Newton steps of many bodies by the relative motions of their contacts, whose number is half that of the sides.

With the motions v of both sides of every contact (`problem.Problem`, form ``sides``) a step is

    dv + D (E^T S E dv - k dv) = -R,    d = E v

where S, the derivative of the forces, feels the relative motions d alone. With A = 1 - D k of each body by itself

    dv = -A^-1 R - A^-1 D E^T S dd,    (1 + E A^-1 D E^T S) dd = -E A^-1 R

and of d only what S feels: three coordinates of a patch with one point. A is what the body does without contacts, and
singular where that is at resonance without damping: then the sides are solved for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..data import Array, ComplexArray, Indices
from .blocks import Matrix, one_plus

LEFT = 1e-6
"""Share of the right side that a step may leave: of Newton's method, which sees the rest in the next one."""


@dataclass(frozen=True, eq=False)
class Side:
    """A side of a contact: number of the contact, of the body, its coordinates among the body's, and its sign."""

    contact: int
    part: int
    at: slice
    sign: float


Alone = tuple[ComplexArray, ComplexArray]
"""(H + 1, c_i, c_i) A^-1 and A^-1 D of a part."""


def alone(compliance: Sequence[ComplexArray], stiffness: Sequence[Array]) -> list[Alone] | None:
    """What the parts do without contacts, from (H + 1, c_i, c_i) D and (c_i, c_i) k of each; None where one is at
    resonance there."""
    found = list[Alone]()
    for D, k in zip(compliance, stiffness, strict=True):
        try:
            inverse = np.linalg.inv(np.eye(len(k)) - D @ k).astype(complex)
        except np.linalg.LinAlgError:
            return None
        found.append((inverse, inverse @ D))
    return found


@dataclass(frozen=True, eq=False)
class Joints:
    """1 + D (E^T S E - k), see above.

    Attributes:
        alone: of each part, see `alone`; None: of one there is nothing. slopes: of each contact (k, W, k, W) S.
        sides: of all contacts. slices: coordinates of each part. scale: (c,) of a unit of x. blocks: the same matrix,
            of the sides.
    """

    alone: list[Alone] | None
    slopes: list[Array]
    sides: list[Side]
    slices: list[slice]
    scale: Array
    blocks: Callable[[], Matrix]

    @property
    def coefficients(self) -> int:
        return self.slopes[0].shape[1]

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
        free = self._of_parts(0, R)
        force = self._across(self._relative.solve(_flat(self._felt(free))))
        dv = free - self._answered(force)
        again = self._across(_flat(self._felt(dv)))
        off, size = _flat([f - g for f, g in zip(force, again, strict=True)]), _flat(force)
        return dv if np.abs(off).max(initial=0.0) <= LEFT * np.abs(size).max(initial=0.0) else None

    @cached_property
    def _active(self) -> list[Indices]:
        """Of each contact the coordinates that its forces feel."""
        return [np.flatnonzero(np.abs(S).max(axis=(0, 1, 3)) > 0) for S in self.slopes]

    def _felt(self, v: Array) -> list[Array]:
        """Of each contact (W, a) relative motions that it feels, from (W, c)."""
        out = [np.zeros((self.coefficients, len(a))) for a in self._active]
        for one in self.sides:
            out[one.contact] += one.sign * v[:, self.slices[one.part]][:, one.at][:, self._active[one.contact]]
        return out

    @cached_property
    def _felt_slopes(self) -> list[Array]:
        """Of each contact (W k, W a) S, both ordered by harmonics."""
        W = self.coefficients
        return [
            S[:, :, a].transpose(1, 0, 3, 2).reshape(W * len(S), W * len(a))
            for S, a in zip(self.slopes, self._active, strict=True)
        ]

    def _across(self, d: Array) -> list[Array]:
        """Of each contact (W, k) forces S d."""
        ends = np.cumsum([S.shape[1] for S in self._felt_slopes])[:-1]
        pairs = zip(self._felt_slopes, np.split(d, ends), strict=True)
        return [(S @ own).reshape(self.coefficients, -1) for S, own in pairs]

    def _answered(self, force: list[Array]) -> Array:
        """(W, c) A^-1 D E^T of forces."""
        out = np.zeros((self.coefficients, self.slices[-1].stop))
        for one in self.sides:
            out[:, self.slices[one.part]][:, one.at] += one.sign * force[one.contact]
        return self._of_parts(1, out)

    @cached_property
    def _alike(self) -> list[tuple[list[int], list[list[Side]]]]:
        """Parts whose sides stand and feel alike, and of each its sides."""
        by_part: dict[int, list[Side]] = {i: [] for i in range(len(self.slices))}
        for one in self.sides:
            by_part[one.part].append(one)
        found: dict[tuple[object, ...], list[int]] = {}
        for i, own in by_part.items():
            stands = ((x.at.start, x.at.stop, self._active[x.contact].tobytes()) for x in own)
            found.setdefault((self.slices[i].stop - self.slices[i].start, *stands), []).append(i)
        return [(parts, [by_part[i] for i in parts]) for parts in found.values()]

    def _of_parts(self, which: int, v: Array) -> Array:
        """(W, c) what every part makes of its own, by one of the matrices in `alone`."""
        out = np.empty_like(v)
        for parts, _ in self._alike:
            D = np.array([(self.alone or [])[i][which] for i in parts])
            own = np.array([v[:, self.slices[i]] for i in parts])
            for i, one in zip(parts, applied(D, own[..., None])[..., 0], strict=True):
                out[:, self.slices[i]] = one
        return out

    @cached_property
    def _relative(self) -> Matrix:
        """1 + E A^-1 D E^T S, contact by contact."""
        pieces: dict[tuple[int, int], Array] = {}
        W = self.coefficients
        for parts, sides in self._alike:
            feel = [self._active[one.contact] for one in sides[0]]
            rows = np.concatenate([one.at.start + a for one, a in zip(sides[0], feel, strict=True)] or [[]]).astype(int)
            loose = np.array([(self.alone or [])[i][1][:, rows] for i in parts])
            ends = np.cumsum([len(a) for a in feel])[:-1]
            for n, by in enumerate(sides[0]):
                S = np.array([self._felt_slopes[own[n].contact] for own in sides])
                moved = applied(loose[..., by.at], S.reshape(len(parts), W, S.shape[1] // W, S.shape[2]))
                for m, block in enumerate(np.split(moved, ends, axis=2)):
                    block = block.reshape(len(parts), W * len(feel[m]), S.shape[2])
                    for own, one in zip(sides, block, strict=True):
                        key = own[m].contact, own[n].contact
                        one = one if own[m].sign == own[n].sign else -one
                        pieces[key] = pieces[key] + one if key in pieces else one
        return one_plus(pieces, [len(a) for a in self._active], W, by_parts=True)


def _flat(values: list[Array]) -> Array:
    return np.concatenate([v.ravel() for v in values])


def applied(D: ComplexArray, V: Array) -> Array:
    """(..., W, c, m) matrices (..., H + 1, c, k) of the harmonics applied to (..., W, k, m)."""
    out = np.empty((*D.shape[:-3], V.shape[-3], D.shape[-2], V.shape[-1]))
    out[..., 0, :, :] = D[..., 0, :, :].real @ V[..., 0, :, :]
    amplitude = D[..., 1:, :, :] @ (V[..., 1::2, :, :] - 1j * V[..., 2::2, :, :])
    out[..., 1::2, :, :], out[..., 2::2, :, :] = amplitude.real, -amplitude.imag
    return out
