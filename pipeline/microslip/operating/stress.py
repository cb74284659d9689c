"""Stress over the cycle of a steady vibration, at every place where a modal file has stress modes.

The equivalent stress of von Mises is a length: with the five numbers s = D sigma it is |s|. So its square is a
trigonometric polynomial of order 2H of the time where the stress is one of order H, known exactly from its
coefficients, and the largest value over the cycle is found by samples and Newton's method, not by samples alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..data import Array, ComplexArray, Flags, Indices, ModalGroup, StressSet
from ..errors import UserError
from ..modal.stress import outside
from .cycle import SAMPLES, longest, wave_top
from .motion import Motion, Part

DEVIATOR = np.array(
    [
        [1.0, -0.5, -0.5, 0.0, 0.0, 0.0],
        [0.0, np.sqrt(0.75), -np.sqrt(0.75), 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, np.sqrt(3.0), 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, np.sqrt(3.0), 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(3.0)],
    ]
)
"""(5, 6) D: von Mises stress = |D sigma|, sigma in the order `VOIGT`."""


_MEMORY = 2**25
"""Bytes of a block of places that is worked on at once."""


@dataclass(frozen=True)
class CycleStress:
    """What the stress at s places does in one cycle, at one frequency. Pa.

    Attributes:
        points: (s, 3) m. amplitude: (s,) largest von Mises stress of sigma(t) - mean over the cycle. mean: (s,) von
            Mises stress of static state and mean, with the sign of its first invariant. largest: (s,) von Mises stress
            of all together at its largest. harmonics: (s, H + 1, 6) complex, the first of them the mean with the
            static state. singular: (s,) in a singular zone, where numbers are the mesh's (docs/results.md).
    """

    points: Array
    amplitude: Array
    mean: Array
    largest: Array
    harmonics: ComplexArray
    singular: Flags

    @property
    def counted(self) -> Indices:
        """Numbers of the places outside the singular zones; all, where none is left."""
        return outside(self.singular)

    @property
    def highest(self) -> float:
        """Pa, the largest amplitude of the places that count."""
        return float(self.amplitude[self.counted].max())

    @property
    def top(self) -> float:
        """Pa, the largest stress of the places that count, at any time."""
        return float(self.largest[self.counted].max())

    @property
    def means(self) -> tuple[float, float]:
        """Pa, the smallest and the largest mean of the places that count."""
        mean = self.mean[self.counted]
        return float(mean.min()), float(mean.max())


def stress_set(group: ModalGroup, location: str = "nodes") -> StressSet:
    """The stress modes of a group.

    Raises:
        UserError: the modal file has none there.
    """
    if location not in group.stresses:
        key = {"nodes": "output.nodal_stress", "gauss": "output.gauss"}.get(location, "output")
        of = f" at nodal diameter {group.harmonic}" if group.harmonic else ""
        more = " and the nodal diameter in output.stress_nodal_diameters" if group.harmonic else ""
        raise UserError(
            f"stress: the modal file has no stress modes '{location}'{of}; write it again with {key} = true{more}"
        )
    return group.stresses[location]


def places(motion: Motion, location: str = "nodes") -> Array:
    """(s, 3) m, where the stress is known."""
    return stress_set(motion.parts[0].group, location).points


def singular(group: ModalGroup, location: str = "nodes") -> Flags:
    """(s,) which places lie in a singular zone; none, where the modal file does not say so."""
    found = stress_set(group, location)
    return np.asarray(found.singular, dtype=bool) if len(found.singular) else np.zeros(len(found.points), dtype=bool)


def counted(group: ModalGroup, location: str = "nodes") -> Indices:
    """Numbers of the places outside the singular zones; all, where none is left."""
    return outside(singular(group, location))


READS_THE_MESH = (
    "stands in the singular zone of a support, a contact's edge or a sharp inner edge, so that what it reads is a "
    "property of the mesh"
)


def in_singular_zone(group: ModalGroup, point: Array) -> bool:
    """Whether a point (3,), a gauge's say, lies in a singular zone: what holds for the nearest node holds for it."""
    if "nodes" not in group.stresses:
        return False
    away = np.linalg.norm(group.stresses["nodes"].points - point, axis=1)
    return bool(singular(group)[away.argmin()])


def stress_at(motion: Motion, chosen: slice | list[int] | Array, location: str = "nodes") -> ComplexArray:
    """(f, H + 1, s, 6) harmonics of the stress at some places, Pa; the mean holds the static stress at speed.

    sigma(t) = sigma_static + sum over h of Re(T_sigma q_h exp(i h Omega t)) (Sextro Eq. (2.4-17)).
    """
    found = motion.of(
        lambda g: stress_set(g, location).stress[chosen],
        lambda r: r.stress[location][chosen],
    )
    found[:, 0] += stress_set(motion.parts[0].group, location).static_stress[chosen]
    return found


def cycle_stress(motion: Motion, point: int = 0, location: str = "nodes") -> CycleStress:
    """The stress of all places over the cycle, at one point of a sweep."""
    one, s = motion.at(point), len(places(motion, location))
    parts = [stress_at(one, block, location)[0] for block in _blocks(s, motion.harmonics)]
    sigma = np.concatenate(parts, axis=1).transpose(1, 0, 2)
    mean, alternating, largest = equivalent(sigma)
    zones = singular(motion.parts[0].group, location)
    return CycleStress(places(motion, location), alternating, mean, largest, sigma, zones)


@dataclass(frozen=True)
class StressPeaks:
    """The most stressed place at each of f points of a sweep. Pa, m.

    Attributes:
        amplitude, mean, largest: (f,) see `CycleStress`; mean is that of the place of the largest amplitude. place:
            (f,) number of the place of the largest amplitude. points: (f, 3) where it is.
    """

    amplitude: Array
    mean: Array
    largest: Array
    place: Array
    points: Array


def stress_peaks(
    motion: Motion,
    location: str = "nodes",
    only: Array | None = None,
    first_harmonic: bool = False,
    largest: bool = True,
) -> StressPeaks:
    """The most stressed place of every point of a sweep, block by block of places.

    Args:
        only: numbers of the places looked at, those outside the singular zones if None. first_harmonic: the amplitude
            of the first harmonic alone (the book's, 5.5: "monofrequent"); mean and higher harmonics then count in
            `largest` alone. largest: whether that is wanted; -1 if not.
    """
    at, f = places(motion, location), motion.count
    chosen = counted(motion.parts[0].group, location) if only is None else np.asarray(only)
    if not len(chosen):
        raise UserError("stress: no place is left to look at")
    kept = [_Highest.none(f, True, first_harmonic), _Highest.none(f, False, False)][: 2 if largest else 1]
    for block in _blocks(len(chosen), motion.harmonics, f):
        s = _Deviators.at(motion, chosen[block], location)
        kept = [k.with_places(s, chosen[block]) for k in kept]
    swing, most = kept[0], kept[-1] if largest else _Highest.none(f, False, False)
    mean = np.array([_mean(stress_at(motion.at(i), [swing.place[i]], location)[0, 0, 0].real) for i in range(f)])
    return StressPeaks(swing.value, mean, most.value, swing.place, at[swing.place])


@dataclass(frozen=True)
class _Deviators:
    """Harmonics of D sigma at p places and f points of a sweep, real and imaginary parts apart.

    parts: (H + 1, 2, 5, f, p), component by component, because squares of whole planes are summed.
    """

    parts: Array

    @classmethod
    def at(cls, motion: Motion, chosen: Array, location: str) -> _Deviators:
        out = np.empty((motion.harmonics + 1, 2, 5, motion.count, len(chosen)))
        for to, part in zip(out, motion.parts, strict=True):
            to[:] = _planes(part, part.q, stress_set(part.group, location).stress[chosen])
            if part.group.residual is not None and part.forces.shape[1]:
                to += _planes(part, part.forces, part.group.residual.stress[location][chosen])
        out[0, 0] += (DEVIATOR @ stress_set(motion.parts[0].group, location).static_stress[chosen].T)[:, None]
        return cls(out)

    def lengths(self, harmonic: int) -> Array:
        """(f, p) largest length over the cycle of one harmonic alone; of the mean its length."""
        a, b = self.parts[harmonic]
        A = np.einsum("dfp,dfp->fp", a, a)
        if harmonic == 0:
            return np.sqrt(A)
        B, C = np.einsum("dfp,dfp->fp", b, b), np.einsum("dfp,dfp->fp", a, b)
        return np.sqrt(0.5 * (A + B + np.hypot(A - B, 2 * C)))

    def chosen(self, f: Array, p: Array) -> ComplexArray:
        """(n, H + 1, 5) complex of n pairs of a point of the sweep and a place."""
        a = self.parts[:, :, :, f, p]
        return np.moveaxis(a[:, 0] + 1j * a[:, 1], -1, 0)


def _planes(part: Part, q: ComplexArray, stress: Array) -> Array:
    """(2, 5, f, p) real and imaginary part of D T q for stress rows T (p, 6, m)."""
    rows = np.einsum("ab,pbm->amp", DEVIATOR, stress)
    if not np.iscomplexobj(rows):
        return np.stack([np.matmul(q.real, rows), np.matmul(q.imag, rows)])
    rows = rows.conj() if part.conjugate else rows
    re, im = np.ascontiguousarray(rows.real), np.ascontiguousarray(rows.imag)
    return np.stack([np.matmul(q.real, re) - np.matmul(q.imag, im), np.matmul(q.imag, re) + np.matmul(q.real, im)])


@dataclass(frozen=True)
class _Highest:
    """The largest length over the cycle found so far, and where, for f points of a sweep.

    swing: of the alternating part alone. first: of the first harmonic alone.
    """

    value: Array
    place: Array
    swing: bool
    first: bool

    @classmethod
    def none(cls, points: int, swing: bool, first: bool) -> _Highest:
        return cls(np.full(points, -1.0), np.zeros(points, dtype=int), swing, first)

    def with_places(self, s: _Deviators, places: Array) -> _Highest:
        """Of more places; waves are followed only where a bound allows a record.

        The length never exceeds the sum of those of the harmonics.
        """
        H = len(s.parts) - 1
        counted = range(1 if self.swing else 0, 1 + (min(H, 1) if self.first else H))
        bound = sum((s.lengths(h) for h in counted), np.zeros(s.parts.shape[3:]))
        f, first = np.arange(len(bound)), bound.argmax(axis=1)
        value, place = self.value.copy(), self.place.copy()
        self._keep(s, places, f, first, value, place)
        record = bound > value[:, None] * (1 + 1e-12)
        record[f, first] = False
        points, here = np.nonzero(record)
        for turn in range(0, len(points), 20000):
            some = slice(turn, turn + 20000)
            self._keep(s, places, points[some], here[some], value, place)
        return _Highest(value, place, self.swing, self.first)

    def _keep(self, s: _Deviators, places: Array, f: Array, i: Array, value: Array, place: Array) -> None:
        found = self._length(s.chosen(f, i))
        order = np.argsort(found)  # of several at one point of the sweep the highest is written last
        f, i, found = f[order], i[order], found[order]
        up = found > value[f]
        value[f[up]], place[f[up]] = found[up], places[i[up]]

    def _length(self, s: ComplexArray) -> Array:
        if s.shape[-2] == 1:
            return np.zeros(len(s)) if self.swing else np.linalg.norm(s[..., 0, :].real, axis=-1)
        if self.swing and (self.first or s.shape[-2] == 2):
            return longest(s[..., 1, :])
        return _longest_of_wave(_alternating(s) if self.swing else s)


def _alternating(s: ComplexArray) -> ComplexArray:
    swing = s.copy()
    swing[..., 0, :] = 0.0
    return swing


def _blocks(count: int, harmonics: int, points: int = 1) -> Iterator[slice]:
    """Places in blocks that keep the memory bounded."""
    step = max(_MEMORY // (8 * 20 * points * (harmonics + 1)), 16)
    return (slice(i, i + step) for i in range(0, count, step))


def equivalent(sigma: ComplexArray, first_harmonic: bool = False) -> tuple[Array, Array, Array]:
    """Mean with its sign, amplitude, and largest von Mises stress over the cycle of (..., H + 1, 6) harmonics.

    The amplitude is the largest von Mises stress of sigma(t) - mean: sqrt(3 J2) of the alternating part, as in the
    criteria of Sines and Crossland; for one harmonic half the longest axis of the ellipse that the deviator runs
    through. The mean is that of Manson and McKnight: the von Mises stress of the mean with the sign of its first
    invariant. See docs/results.md.
    """
    s = sigma @ DEVIATOR.T
    mean = _mean(sigma[..., 0, :].real)
    H = sigma.shape[-2] - 1
    if first_harmonic or H <= 1:
        amplitude = longest(s[..., 1, :]) if H else np.zeros(mean.shape)
    else:
        amplitude = _longest_of_wave(_alternating(s))
    return mean, amplitude, _longest_of_wave(s)


def _mean(steady: Array) -> Array:
    """(...,) von Mises stress of (..., 6), negative in compression; shear, whose trace is rounding, is not."""
    size, trace = np.linalg.norm(steady @ DEVIATOR.T, axis=-1), steady[..., :3].sum(axis=-1)
    return np.where(trace < -1e-6 * size, -size, size)


def _longest_of_wave(s: ComplexArray) -> Array:
    """Largest length over the cycle of vectors of (..., H + 1, d) harmonics."""
    return np.sqrt(np.maximum(wave_top(_square(s), SAMPLES), 0.0))


def _square(s: ComplexArray) -> ComplexArray:
    """(..., 2 H + 1) harmonics of |x(t)|^2 of a vector wave, the sum of products of its harmonics.

    With c_h = a_h/2 for h > 0, c_0 = a_0, c_-h = conj(c_h): x = sum c_h exp(i h t) and
    |x|^2 = sum c_g . c_h exp(i (g + h) t).
    """
    H = s.shape[-2] - 1
    c = 0.5 * s
    c[..., 0, :] = s[..., 0, :].real
    both = np.concatenate([np.conj(c[..., :0:-1, :]), c], axis=-2)  # h = -H ... H
    found = np.zeros((*s.shape[:-2], 2 * H + 1), dtype=complex)
    for n in range(2 * H + 1):  # h from n - H to H goes with n - h
        h = np.arange(n - H, H + 1)
        found[..., n] = (both[..., h + H, :] * both[..., n - h + H, :]).sum(axis=(-1, -2))
    found[..., 1:] *= 2.0
    return found
