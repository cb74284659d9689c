"""Amplitudes of read-outs with all derivatives, for whatever looks for their peaks or prescribes them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import continuation
from ..continuation import SEARCH, Peak, Settings
from ..data import Array, ComplexArray, largest
from ..series import amplitudes
from ..system.assembly import Assembly
from ..units import METRES, Quantity
from .problem import AtFrequency, Problem


def measured(assembly: Assembly, output: int = 0) -> Quantity:
    """What a read-out of an assembly measures: by the unit of its row; metres where nothing is read."""
    if output >= len(assembly.outputs):
        return METRES
    w = assembly.outputs[output]
    group = next(iter(next(m for m in assembly.components if m.name == w.component).groups.values()))
    of_gauge = w.monitor in group.gauges and w.label in group.gauges[w.monitor].labels
    rows = (group.gauges if of_gauge else group.monitors).get(w.monitor)
    return METRES if rows is None else Quantity(rows.unit)


@dataclass(frozen=True)
class Amplitude:
    """Complex 0-peak amplitude of a read-out in one harmonic, and its derivatives.

    Attributes:
        value: m. by_x: (size,) m. rate: with respect to Omega, m s.
    """

    value: complex
    by_x: ComplexArray
    rate: complex


def amplitude(
    at: AtFrequency, x: Array, force: Array, slopes: list[Array], output: int = 0, harmonic: int = 1
) -> Amplitude:
    """The amplitude of read-out number `output` for forces (W, c) and their derivatives as `AtFrequency.forces` gives.

    y = W q + e - r F with q = q_ref - X (F - k v): linear in the forces and in v.
    """
    rows = [(one.output[output], one.output_residual[output], one.output_given[output])
            for one in at.problem.parts[harmonic]]  # fmt: skip
    return weighted(at, x, force, slopes, harmonic, rows)


def weighted(
    at: AtFrequency, x: Array, force: Array, slopes: list[Array], harmonic: int,
    rows: list[tuple[ComplexArray, ComplexArray, complex]],
) -> Amplitude:  # fmt: skip
    """The amplitude W q + e - r F of rows (W (m,), r (c,), e), one for each part; see `amplitude`."""
    p, h = at.problem, harmonic
    share = p.share if h else 1.0
    v, f = amplitudes(p.displacement(x))[h], amplitudes(force)[h]
    of_force, of_motion = np.zeros(p.count, dtype=complex), np.zeros(p.count, dtype=complex)
    value, by_Omega = 0.0j, 0.0j
    for (row, beside, given), seen, k, s in zip(rows, at.seen[h], p.stiffness, p.slices, strict=True):
        excess = f[s] - k @ v[s]
        driven = share * (row @ seen.modal + given)
        value += complex(driven - row @ (seen.modal_compliance @ excess) - beside @ f[s])
        by_Omega += complex(share * (row @ seen.modal_rate) - row @ (seen.modal_compliance_rate @ excess))
        of_force[s] = -(row @ seen.modal_compliance + beside)
        of_motion[s] = row @ seen.modal_compliance @ k
    by_v = _through(p, of_force, slopes, h)
    for wave, unit in _waves(h):
        by_v[wave] += unit * of_motion
    if (rates := at.force_rates(x)) is not None:
        for wave, unit in _waves(h):
            by_Omega += complex(unit * (of_force @ rates[wave]))
    return Amplitude(complex(value), (by_v * p.scale).ravel(), complex(by_Omega))


def seen(
    at: AtFrequency, motion: list[list[ComplexArray]], force: Array, output: int = 0, harmonic: int = 1
) -> complex:
    """The value of `amplitude` alone, m, of the bodies' amplitudes and the forces (W, c)."""
    p, f = at.problem, amplitudes(force)[harmonic]
    return sum(
        complex(part.output[output] @ q + p.share * part.output_given[output] - part.output_residual[output] @ f[s])
        for part, q, s in zip(p.parts[harmonic], motion[harmonic], p.slices, strict=True)
    )


def _waves(harmonic: int) -> list[tuple[int, complex]]:
    """Entries of a signal's harmonics that make up an amplitude, cos part - i sin part, and their factors."""
    return [(2 * harmonic - 1, 1.0), (2 * harmonic, -1.0j)] if harmonic else [(0, 1.0)]


def _through(p: Problem, weights: ComplexArray, slopes: list[Array], harmonic: int) -> ComplexArray:
    """(W, c) derivative of weights (c,) times the forces' amplitude."""
    out = np.zeros((p.coefficients, p.count), dtype=complex)
    for g, S in zip(p.groups, slopes, strict=True):
        weight = weights[g.first] - (0.0 if g.second is None else weights[g.second])
        gained = sum(unit * np.einsum("nk,nklz->znl", weight, S[:, :, wave]) for wave, unit in _waves(harmonic))
        out[:, g.first] += gained
        if g.second is not None:
            out[:, g.second] -= gained
    return out


class WithOutput:
    """A problem whose output is the squared amplitude of a read-out, as `continuation.extremum` asks for it.

    The forces found last are kept: residual, derivative and output of one place cost them once.
    """

    def __init__(self, problem: Problem, output: int = 0, harmonic: int = 1) -> None:
        self.problem, self.number, self.harmonic = problem, output, harmonic
        self._kept: tuple[bytes, float, AtFrequency, Array, list[Array]] | None = None

    @property
    def x_scale(self) -> float:
        return self.problem.x_scale

    @property
    def lam_scale(self) -> float:
        return self.problem.lam_scale

    def evaluate(self, x: Array, Omega: float) -> tuple[Array, Array, Array]:
        """See `Problem.evaluate`."""
        at, force, slopes = self._at(x, Omega)
        return at.residual_of(x, force), at.jacobian(slopes).dense(), at.rate(x, force)

    def output(self, x: Array, Omega: float) -> tuple[float, Array, float]:
        """|y|^2 in m2 and its derivatives with respect to x and Omega."""
        at, force, slopes = self._at(x, Omega)
        y = amplitude(at, x, force, slopes, self.number, self.harmonic)
        turned = 2.0 * np.conj(y.value)
        return abs(y.value) ** 2, (turned * y.by_x).real, float((turned * y.rate).real)

    def _at(self, x: Array, Omega: float) -> tuple[AtFrequency, Array, list[Array]]:
        key = np.asarray(x, dtype=float).tobytes()
        if self._kept is None or self._kept[:2] != (key, Omega):
            at = self.problem.at(Omega)
            self._kept = (key, Omega, at, *at.forces(x))
        return self._kept[2:]


def climbed(problem: Problem, x: Array, Omega: float, settings: Settings = SEARCH) -> Peak:
    """The peak of the first read-out uphill from a motion x (size,) at Omega (rad/s), along the curve;
    its steps are shares of the motion where that is large."""
    large = max(problem.x_scale, largest(x))
    return continuation.peak(WithOutput(replace(problem, x_scale=large)), x, Omega, settings)
