"""The coordinates of the bodies eliminated exactly: what is left are the harmonics of the contact coordinates.

In each harmonic h of the excitation (`system.assembly.Linear`)

    S_h q = f_h - T^H (F_h - p_h),    S_h = K - (h Omega)^2 M + i h Omega C
    d_h = T q - B (F_h - p_h) + e_h

with the rows T of the contact coordinates, the contact forces F, the preload p (of harmonic 0), the static compliance
B that the coordinates leave out among the contacts, and e_h what it gives under the excitation. d is the displacement
from the preloaded state. With a stiffness k of the contacts taken into the left side, F - p = k d + g,

    (S_h + T^H k' T) q = f_h - T^H (k' e_h + W g),    k' = k (1 + B k)^-1,    W = (1 + k B)^-1
    d_h = d_ref,h - D_h g_h

Bodies with a loss factor have K + i H and B - i S in the place of K and B there, in every harmonic but the mean.

Any k gives the same answer. That of the sticking contact keeps everything finite: at resonances of the free body,
for a body that nothing but its contacts holds, and the numbers subtracted are of the size of the result. At a
resonance of the body with sticking contacts, without damping, another k does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..data import Array, ComplexArray, largest
from ..system.assembly import Assembly, Linear, stuck_modes


@dataclass(frozen=True)
class Seen:
    """One harmonic at one frequency as seen from c contact coordinates, and its derivative with respect to Omega.

    Attributes:
        reference: (c,) d_ref, under the loads. compliance: (c, c) D, m/N. modal: (m,) q at d_ref.
        modal_compliance: (m, c) what g takes off q. reference_rate, compliance_rate, modal_rate,
            modal_compliance_rate: derivatives, s.
    """

    reference: ComplexArray
    compliance: ComplexArray
    modal: ComplexArray
    modal_compliance: ComplexArray
    reference_rate: ComplexArray
    compliance_rate: ComplexArray
    modal_rate: ComplexArray
    modal_compliance_rate: ComplexArray


def seen(part: Linear, stiffness: Array, Omega: float, harmonic: int) -> Seen:
    """A part in one harmonic of Omega (rad/s). stiffness: (c, c) k."""
    B, T, w = part.yielding, part.rows, harmonic * Omega
    P, W, held, stiff = taken_in(part, stiffness)
    A = part.stiff - w**2 * part.M + 1j * w * part.C + T.conj().T @ held @ T
    driven = part.load - T.conj().T @ (held @ part.given)
    X = solved(A, np.column_stack([driven, T.conj().T @ W]), size := _size(stiff, part.M, part.C, w))
    slope = -2 * harmonic * w * part.M + 1j * harmonic * part.C
    Y = -solved(A, slope @ X, size).astype(complex)
    reference, D = P @ (T @ X[:, 0] + part.given), P @ (T @ X[:, 1:] + B)
    rates = P @ (T @ Y)
    return Seen(reference, D, X[:, 0], X[:, 1:], rates[:, 0], rates[:, 1:], Y[:, 0], Y[:, 1:])


def taken_in(part: Linear, k: Array) -> tuple[Array, Array, Array, ComplexArray]:
    """P = (1 + B k)^-1, W = (1 + k B)^-1, k' = k P and K + T^H k' T of a part with a stiffness (c, c)
    of its contacts taken into it."""
    B, T = part.yielding, part.rows
    P, W = (np.linalg.inv(np.eye(part.count) + a) for a in (B @ k, k @ B))
    return P, W, k @ P, part.stiff + T.conj().T @ (k @ P) @ T


LOST = 1e-3
"""Share of the forces that the rounding of the matrices may make: a motion that takes more is one of rounding."""


def solved(A: Any, right: Array | ComplexArray, size: Array) -> ComplexArray:
    """(..., m, n) X of A X = right. A column is NaN where the sizes (..., m, m) of what the entries of A are sums of
    leave nothing of it: there is no balance, or one without bounds. Where motions that A does not resist are not driven
    either, they are left out.
    """
    try:
        X = np.linalg.solve(A, right)
    except np.linalg.LinAlgError:
        finite = np.isfinite(A).all() and np.isfinite(right).all()
        X = np.linalg.pinv(A, rcond=1e-13) @ right if finite else np.full(right.shape, np.nan, complex)
    with np.errstate(all="ignore"):
        forces = np.abs(right).max(axis=-2, initial=0.0)
        rounding = np.finfo(float).eps * (size @ np.abs(X)).max(axis=-2, initial=0.0)
        off = np.abs(A @ X - right).max(axis=-2, initial=0.0)
        lost = ~((rounding <= LOST * forces) & (off <= LOST * forces))
    return np.where(lost[..., None, :], np.nan, X) if lost.any() else np.asarray(X)


def _size(stiff: ComplexArray, M: Array, C: Array, w: Any) -> Array:
    """(..., m, m) size of the terms that stiff - w^2 M + i w C adds up. w: rad/s, a number or (..., 1, 1)."""
    return np.abs(stiff) + w**2 * np.abs(M) + np.abs(w * C)


View = ComplexArray
"""(..., 2, H + 1, c, 1 + c) of a part at one frequency: value and derivative with respect to Omega, in the harmonics 0
to H, as seen from its c contact coordinates; reference in the first column, then compliance, see `Seen`."""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Views of n parts of c coordinates each, as they act on W = 2 H + 1 real coefficients: mean, cos, sin, cos 2, ...

    A complex D takes cos - i sin to D (cos - i sin): its numbers and those of i D, read as pairs of real ones, are the
    rows that tell the cosines and the sines, from each coordinate's cosine and sine side by side.

    Attributes:
        mean: (n, 2, c, 1 + c) and waves: (n, 2, H, 2 c, 2 (1 + c)) value and derivative with respect to Omega, the
            reference in front; rows of the cosines before those of the sines.
    """

    mean: Array
    waves: Array

    @classmethod
    def of(cls, both: ComplexArray) -> Coefficients:
        """Of n `View`."""
        n, two, count, c, _ = both.shape
        rows = np.empty((n, two, count - 1, 2, c, 1 + c), complex)
        rows[:, :, :, 0] = both[:, :, 1:]
        np.multiply(both[:, :, 1:], 1j, out=rows[:, :, :, 1])
        return cls(both[:, :, 0].real, rows.view(float).reshape(n, two, count - 1, 2 * c, 2 + 2 * c))

    def part(self, i: int) -> Coefficients:
        """One of the parts by itself."""
        return Coefficients(self.mean[i : i + 1], self.waves[i : i + 1]) if len(self.mean) > 1 else self

    def applied(self, V: Array, which: slice) -> Array:
        """(n, 1 or 2, W, c, m) what the compliance, or it and its derivative, make of (n, W, c, m)."""
        n, W, c, m = V.shape
        out = np.empty((n, which.stop, W, c, m))
        np.matmul(self.mean[:, which, :, 1:], V[:, None, 0], out=out[:, :, 0])
        pairs = V[:, 1:].reshape(n, 1, W // 2, 2, c, m).swapaxes(3, 4).reshape(n, 1, W // 2, 2 * c, m)
        np.matmul(self.waves[:, which, :, :, 2:], pairs, out=out[:, :, 1:].reshape(n, which.stop, W // 2, 2 * c, m))
        return out

    def beyond(self, force: Array, which: slice, mean: float, share: float) -> Array:
        """(n, 1 or 2, W, c) the same of (n, W, c), less the mean reference and the others times factors."""
        out = self.applied(force[..., None], which)[..., 0]
        out[:, :, 0] -= mean * self.mean[:, which, :, 0]
        waves = out[:, :, 1:]
        waves -= share * self.waves[:, which, :, :, 0].reshape(waves.shape)
        return out


@dataclass(frozen=True, eq=False)
class Poles:
    """The inverse of s^2 M + s C + K + T^H k' T as a sum over its eigenvalues, of some harmonics of one part, or of n.

    Attributes:
        harmonics: (g,). values: (..., 2m) eigenvalues. left: (..., c, 2m), right: (..., g, 2m, 1 + c) what stands on
            both sides of 1/(s - value), of the loads in the first column. static: (..., g, c, 1 + c) what is added to
            the sums.
    """

    harmonics: Array
    values: ComplexArray
    left: ComplexArray
    right: ComplexArray
    static: ComplexArray

    @classmethod
    def of(cls, each: Sequence[Poles]) -> Poles:
        """Of n parts in the same harmonics."""
        arrays = (np.array([getattr(one, key) for one in each]) for key in ("values", "left", "right", "static"))
        return cls(each[0].harmonics, *arrays)

    @cached_property
    def _near(self) -> Array:
        return MET * np.abs(self.values[..., None, :])

    @cached_property
    def _damped(self) -> bool:
        """Whether no frequency is an eigenvalue."""
        return bool((np.abs(self.values.real)[..., None, :] > self._near).all())

    @cached_property
    def _turning(self) -> ComplexArray:
        """(g, 1) i h."""
        return 1j * self.harmonics[:, None]

    @cached_property
    def _falling(self) -> ComplexArray:
        return -self._turning

    def at(self, Omega: float) -> View | None:
        """(..., 2, g, c, 1 + c) see `View`, at a frequency (rad/s); None where it or one of its harmonics is,
        within `MET`, an eigenvalue."""
        away = Omega * self._turning - self.values[..., None, :]
        if not self._damped and (np.abs(away) <= self._near).any():
            return None
        c, (*n, g, m) = self.left.shape[-2], away.shape
        once = np.divide(1.0, away)[..., None, :]
        rows = np.empty((*n, 2, g, c, m), complex)
        np.multiply(self.left[..., None, :, :], once, out=rows[..., 0, :, :, :])
        np.multiply(rows[..., 0, :, :, :], once * self._falling[..., None], out=rows[..., 1, :, :, :])
        both = rows @ self.right[..., None, :, :, :]
        both[..., 0, :, :, :] += self.static
        return np.asarray(both)


@dataclass(frozen=True, eq=False)
class Eliminated:
    """One part in all harmonics, its coordinates eliminated: what of that does not depend on the frequency.

    Attributes: parts: by harmonic. stiffness: (c, c) k.
    """

    parts: Sequence[Linear]
    stiffness: Array

    def at(self, Omega: float) -> View | None:
        """As seen from the contacts at a frequency (rad/s); None where it is that of a resonance without damping, so
        that the numbers subtracted are without bounds."""
        if self.poles is not None:
            return joined(self.poles, Omega)
        views = [seen(part, self.stiffness, Omega, h) for h, part in enumerate(self.parts)]
        for s in views:  # how fast the coordinates change with the frequency
            moved = np.column_stack([s.modal, s.modal_compliance])
            rates = np.column_stack([s.modal_rate, s.modal_compliance_rate])
            if not Omega * largest(rates) * MET <= largest(moved):
                return None
        return _view(views)

    @cached_property
    def driven(self) -> list[Driven]:
        """By equal matrices, what loads and contact forces beyond those of k do."""
        out = []
        for same in self._same:
            part, T = self.parts[same[0]], self.parts[same[0]].rows
            _, W, held, stiff = taken_in(part, self.stiffness)
            loads = np.array([self.parts[i].load - T.conj().T @ (held @ self.parts[i].given) for i in same])
            out.append(Driven(np.array(same), stiff, part.M, part.C, loads, (T.conj().T @ W).T))
        return out

    def directly(self, Omega: float) -> View:
        """The same from the equations themselves: at a single frequency less work than the eigenvalues."""
        return _view([seen(part, self.stiffness, Omega, h) for h, part in enumerate(self.parts)])

    @cached_property
    def _same(self) -> list[list[int]]:
        """Harmonics by equal matrices."""
        same: list[list[int]] = []
        for h, part in enumerate(self.parts):
            alike = next((group for group in same if _alike(self.parts[group[0]], part)), None)
            if alike is None:
                same.append([h])
            else:
                alike.append(h)
        return same

    @cached_property
    def poles(self) -> list[Poles] | None:
        """By equal matrices; None where the eigenvalues do not give what the equations themselves give.

        So it is of a body that moves freely without its contacts feeling it, or whose eigenvectors nearly coincide.
        """
        each = [self._of(group) for group in self._same]
        return None if any(one is None for one in each) else [one for one in each if one is not None]

    def _of(self, harmonics: list[int]) -> Poles | None:
        part = self.parts[harmonics[0]]
        m, T = len(part.M), part.rows
        if not 0 < m <= POLES_AT_MOST:
            return None
        P, right, held, stiff = taken_in(part, self.stiffness)
        below = -np.linalg.solve(part.M, np.hstack([stiff, part.C]))
        values, V = np.linalg.eig(np.block([[np.zeros((m, m)), np.eye(m)], [below]]))
        if np.abs(values).min() <= 1e-13 * np.abs(values).max():
            return None
        W = np.linalg.solve(V, np.vstack([np.zeros((m, m)), np.linalg.inv(part.M)]))
        loaded = [self.parts[h].given for h in harmonics]
        loads = [self.parts[h].load - T.conj().T @ (held @ e) for h, e in zip(harmonics, loaded, strict=True)]
        driven = np.array([np.column_stack([f, T.conj().T @ right]) for f in loads])
        static = np.array([P @ np.column_stack([e, part.yielding]) for e in loaded])
        poles = Poles(np.array(harmonics), values, P @ T @ V[:m], W @ driven, static)
        return poles if self._right(poles) else None

    def _right(self, poles: Poles) -> bool:
        """Does it give what the equations give, about the geometric mean of the eigenvalues and beside the lowest one?

        Beside: of one mode without damping the mean is the eigenvalue itself, where nothing is finite.
        """
        h = int(poles.harmonics[-1])
        sizes = np.abs(poles.values)
        for Omega in (0.97 * np.exp(np.log(sizes).mean()), 1.01 * sizes.min()):
            both = poles.at(float(Omega) / max(h, 1))
            if both is None:
                return False
            exact = seen(self.parts[h], self.stiffness, float(Omega) / max(h, 1), h)
            for a, b in ((both[0, -1, :, 1:], exact.compliance), (both[0, -1, :, 0], exact.reference)):
                if not largest(a - b) <= 1e-10 * np.abs(b).max(initial=1e-300):
                    return False
        return True


def joined(poles: Sequence[Poles], Omega: float) -> View | None:
    """Of all harmonics together; None where `Poles.at` is."""
    each = [group.at(Omega) for group in poles]
    if len(each) == 1 or any(one is None for one in each):
        return each[0] if len(each) == 1 else None
    *n, _, c, columns = poles[0].static.shape
    both = np.empty((*n, 2, sum(len(group.harmonics) for group in poles), c, columns), complex)
    for group, one in zip(poles, each, strict=True):
        both[..., group.harmonics, :, :] = one
    return both


@dataclass(frozen=True, eq=False)
class Driven:
    """What moves the coordinates of one part, or of n, in harmonics whose matrices are the same.

    Attributes:
        harmonics: (g,). stiff: (..., m, m) K + T^H k' T. M, C: (..., m, m). loads: (..., g, m). given: (..., c, m) what
            contact forces beyond those of k do.
    """

    harmonics: Array
    stiff: ComplexArray
    M: Array
    C: Array
    loads: ComplexArray
    given: ComplexArray

    @classmethod
    def of(cls, each: Sequence[Driven]) -> Driven:
        """Of n parts in the same harmonics."""
        arrays = (np.array([getattr(one, f.name) for one in each]) for f in fields(cls)[1:])
        return cls(each[0].harmonics, *arrays)

    def coordinates(self, Omega: float, share: float, g: ComplexArray) -> ComplexArray:
        """(..., g, m) amplitudes at a frequency (rad/s), under a share of the loads that are not steady and contact
        forces (..., H + 1, c) beyond those of the stiffness k."""
        h = self.harmonics
        w = h[:, None, None] * Omega
        right = self.loads * np.where(h, share, 1.0)[:, None] - g[..., h, :] @ self.given
        stiff, M, C = (one[..., None, :, :] for one in (self.stiff, self.M, self.C))
        return solved(stiff - w**2 * M + 1j * w * C, right[..., None], _size(stiff, M, C, w))[..., 0]


MET = 1e-6
"""Distance of a frequency from a resonance, over it, that costs six of the sixteen digits of a double."""

POLES_AT_MOST = 120
"""Coordinates up to which eigenvalues are found: their cost grows with the cube, and is that of some frequencies."""


def _view(found: Sequence[Seen]) -> View:
    values = [np.column_stack([s.reference, s.compliance]) for s in found]
    rates = [np.column_stack([s.reference_rate, s.compliance_rate]) for s in found]
    return np.array([values, rates])


def _alike(a: Linear, b: Linear) -> bool:
    """Equal but for the loads."""
    pairs = ((a.M, b.M), (a.K, b.K), (a.C, b.C), (a.rows, b.rows), (a.residual, b.residual),
             (a.loss, b.loss), (a.residual_loss, b.residual_loss))  # fmt: skip
    return all(x is y or (x is not None and y is not None and np.array_equal(x, y)) for x, y in pairs)


READS = 1e-10
"""Share of what coordinates as large could make a read-out, below which it reads their rounding: by symmetry, say."""


@dataclass(frozen=True, eq=False)
class ReadOuts:
    """What is read of a body, or of several, in one harmonic; see `system.assembly.Linear`."""

    output: ComplexArray
    output_residual: ComplexArray
    output_given: ComplexArray

    @classmethod
    def of(cls, parts: Sequence[Linear]) -> ReadOuts:
        """Of the coordinates and contact forces of all parts, one after the other."""
        rows, beside = (np.hstack([getattr(one, key) for one in parts]) for key in ("output", "output_residual"))
        return cls(rows, beside, np.sum([one.output_given for one in parts], axis=0))


def monitored(part: Linear | ReadOuts, q: ComplexArray, force: ComplexArray, share: float = 1.0) -> ComplexArray:
    """(w,) read-outs of one harmonic, see `read`."""
    return read([part], q[None], force[None], share)[:, 0]


def read(parts: Sequence[Linear | ReadOuts], q: ComplexArray, force: ComplexArray, share: float = 1.0) -> ComplexArray:
    """(w, g) read-outs by coordinates (g, m), contact forces (g, c) less the preload, and a share of the loads, over g
    harmonics of one wave; parts (g,), equal but for the loads. What is rounding is zero."""
    output, loaded = parts[0].output, np.array([part.output_given for part in parts]).T
    values = output @ q.T - parts[0].output_residual @ force.T + share * loaded
    moved = np.sqrt((output != 0) @ np.abs(q.T) ** 2)  # of the coordinates that a read-out has to do with
    return np.where(np.abs(values) <= READS * np.linalg.norm(output, axis=1)[:, None] * moved, 0.0, values)


def work(
    parts: Sequence[Linear], Omega: float, harmonics: Sequence[int], q: ComplexArray, force: ComplexArray,
    share: float = 1.0,
) -> Array:  # fmt: skip
    """Work of a share of the loads, loss in the bodies' own damping and to circulatory forces, and what the loads would
    do in phase with the speed, J per cycle, and the largest kinetic energy, J, added up over g harmonics of one wave.

    Args:
        parts: (g,), equal but for the loads. harmonics: (g,), not 0. q: (g, m). force: (g, c).
    """
    part, h = parts[0], np.array(harmonics)
    w, moved = Omega * h, np.zeros(len(h), complex)
    for i, one in enumerate(parts):
        if one.load.any() or one.given.any():
            moved[i] = share * (one.load.conj() @ q[i] - one.given.conj() @ force[i])
    lost = w * _squared(part.C, q).real
    if part.loss is not None:
        lost += _squared(part.loss, q).real
    if (turning := part.K - part.K.conj().T).any():
        lost += 0.5 * _squared(turning, q).imag
    if part.residual_loss is not None:
        lost += _squared(part.residual_loss, force).real
    each = -h * moved.imag, h * lost, h * np.abs(moved)
    return np.array([*(np.pi * one.sum() for one in each), 0.5 * (w**2 * _squared(part.M, q).real).sum()])


def _squared(A: Array, q: ComplexArray) -> ComplexArray:
    """(g,) q^H A q of every row of (g, m)."""
    return (q.conj() * (q @ A.T)).sum(axis=1)


def untouched(part: Linear) -> Linear:
    """The same without its contacts."""
    lost = None if part.residual_loss is None else part.residual_loss[:0, :0]
    return replace(part, rows=part.rows[:0], residual=part.residual[:0, :0], residual_loss=lost)


def stuck(part: Linear, stiffness: Array) -> Array:
    """(m,) eigenfrequencies in Hz with contacts of a stiffness (c, c), damping and gyroscopic forces left out."""
    return np.sqrt(np.maximum(stuck_modes(part, stiffness)[0], 0.0)) / (2 * np.pi)


def stuck_damping(part: Linear, stiffness: Array) -> Array:
    """(m,) damping ratios that the modes of `stuck` have, from what they lose in a cycle: half-power widths 2 D f.

    D = phi^H (omega C + H) phi / (2 omega^2) with phi^H M phi = 1, and what the compliance beside the coordinates
    loses; 0 of motions that nothing holds.
    """
    values, shapes = stuck_modes(part, stiffness)
    omega = np.sqrt(np.maximum(values, 0.0))
    lost = omega * _of_each(part.C, shapes)
    if part.loss is not None:
        lost += _of_each(part.loss, shapes)
    if part.residual_loss is not None:
        force = np.linalg.solve(np.eye(part.count) + stiffness @ part.residual, stiffness @ (part.rows @ shapes))
        lost += _of_each(part.residual_loss, force)
    held = values > 1e-9 * largest(values)
    return np.divide(lost, 2 * values, out=np.zeros_like(lost), where=held)


def own_coordinates(assembly: Assembly, harmonic: int) -> list[slice]:
    """Of each component, its coordinates among those of all."""
    groups = [m.at(assembly.index(harmonic)).group for m in assembly.components]
    ends = np.cumsum([0, *(len(group.M_r) for group in groups)]).tolist()
    return [slice(begin, end) for begin, end in pairwise(ends)]


def sticking_and_free(assembly: Assembly) -> tuple[Array, Array]:
    """(m,) Hz of the modes with sticking contacts, then of those without contacts, and damping ratios."""
    part = assembly.joined(1)
    pairs = ((part, assembly.stiffness), (untouched(part), np.zeros((0, 0))))
    modes, damping = zip(*((stuck(one, k), stuck_damping(one, k)) for one, k in pairs), strict=True)
    return np.concatenate(modes), np.concatenate(damping)


def _of_each(A: Array, shapes: Array) -> Array:
    """(m,) real phi^H A phi of every column."""
    return np.einsum("im,ij,jm->m", shapes.conj(), A, shapes, optimize=True).real
