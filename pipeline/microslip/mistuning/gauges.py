"""How the blades of a ring differ, from the amplitudes that gauges on all of them show at a few frequencies.

The ring is linear: its contacts stick. With one deviation d_j a blade, of all its frequencies together,

    A(d) q = f,    A(d) = A(0) + sum_j ((1 + d_j)^2 - 1) (K_j + i H_j) + i Omega d_j C_j,    y = O q + y_0

so that, by the transposed equation A^T z = O^T, dy/dd_j = -z^T (dA/dd_j) q and d|y|/dd_j = Re(conj(y) dy/dd_j)/|y|
(Sextro Eqs. (5.6-2) to (5.6-4), errata): one factorisation a frequency gives the amplitudes and all their derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.typing import ArrayLike

from ..data import Array
from ..errors import UserError
from ..harmonic_balance.reduced import own_coordinates
from ..settings.arguments import Index, Rows, Vector, checked, numbers
from ..settings.numbers import Positive
from ..system.assembly import Assembly, Linear
from .identification import Estimate, accepted, covariance, misfit
from .linear import held
from .ring import Tuned
from .scatter import Scatter

STARTS = 12
"""Starts of the search at most."""


@dataclass(frozen=True, eq=False)
class FromGauges(Estimate):
    """Attributes: level: factor of all loads, 1 where they are known. level_accuracy: its standard deviation. The
    others are those of `Estimate`."""

    level: float
    level_accuracy: float


@dataclass(frozen=True, eq=False)
class Stuck:
    """A ring with sticking contacts over the deviations of its blades. Attributes: tuned. component: see `Scatter`."""

    tuned: Tuned
    component: str | None = None

    def __post_init__(self) -> None:
        if self.tuned.body(Scatter("frequency", deviation=1.0, component=self.component)).sectors > 1:
            raise UserError("ring: is a disc in one piece, whose blades have no frequencies of their own")
        if self.tuned.whole.stuck_damping is not None:
            raise UserError(
                "damping: of the modes of the stuck ring changes with the blades; give the blades damping of their own"
            )

    @cached_property
    def part(self) -> Linear:
        """The tuned ring, its contacts' stiffness in K."""
        return held(self.tuned.whole.joined(1), self.tuned.whole.stiffness)

    @cached_property
    def blades(self) -> list[tuple[slice, Array, Array]]:
        """By sector the blade's coordinates, K_j + i H_j and C_j: a third, and the whole, of what a ring of blades
        twice as fast has more than the tuned one."""
        s = Scatter("frequency", deviation=1.0, component=self.component)
        ring = self.tuned.mistuned([(s, np.ones((self.tuned.sectors, self.tuned.modes(s))))])
        part, other = self.tuned.whole.joined(1), ring.joined(1)
        stiff, viscous = (other.stiff - part.stiff) / 3, other.C - part.C
        own = own_coordinates(ring, 0)
        return [(s, stiff[s, s], viscous[s, s]) for s in own if stiff[s, s].any()]

    def amplitudes(self, frequency: float, deviation: Array) -> tuple[Array, Array]:
        """At a frequency (Hz): (w,) complex read-outs, and (w, N) their derivatives with respect to the deviations."""
        part, w = self.part, 2 * np.pi * frequency
        A = part.K - w**2 * part.M + 1j * w * part.C
        for d, (s, stiff, viscous) in zip(deviation, self.blades, strict=True):
            A[s, s] += ((1 + d) ** 2 - 1) * stiff + 1j * w * d * viscous
        factors = scipy.linalg.lu_factor(A)
        q = scipy.linalg.lu_solve(factors, part.load)
        Z = scipy.linalg.lu_solve(factors, part.output.T, trans=1)
        changes = [
            -Z[s].T @ ((2 * (1 + d) * stiff + 1j * w * viscous) @ q[s])
            for d, (s, stiff, viscous) in zip(deviation, self.blades, strict=True)
        ]
        return part.output @ q + part.output_given, np.array(changes).T


@checked
def blades_from_gauges(
    ring: Assembly | Stuck, frequency: Vector, amplitude: Rows, noise: Annotated[Any, numbers(0, 2)],
    find_level: bool = False, spread: Positive = 0.01, seed: Index = 0,
) -> FromGauges:  # fmt: skip
    """Blade frequencies of a ring with sticking contacts, from amplitudes of the read-outs of all sectors.

    Amplitudes near a resonance turn over as deviations grow, beside it they do not. So the search begins with the
    frequencies at which they depend on the deviations least, and takes in the others from there; where what it ends at
    does not fit, it begins again from other deviations, drawn. The best is kept, and says whether it fits.

    Args:
        ring: the tuned one, by the sector that stands for it. frequency: (f,) Hz, two or more of them beside the band
            in which the blades resonate. amplitude: (f, w) 0-peak, in the unit of the read-outs, in the order of the
            sectors. noise: standard deviation of an amplitude over it, one or (f, w). find_level: the factor of all
            loads is found as well. spread: standard deviation of what further starts are drawn from.

    Raises:
        UserError: amplitudes that do not fit the read-outs, are not positive, or fewer than unknowns; no ring.
    """
    if isinstance(ring, Assembly) and ring.ring is None:
        raise UserError("ring: give the sector that stands for a ring, with its number of blades")
    stuck = ring if isinstance(ring, Stuck) else Stuck(Tuned(ring, {}))
    readings = _Readings.of(stuck, frequency, amplitude, noise, find_level)
    parts = readings.calm_first()
    rng, best = np.random.default_rng(seed), None
    for start in range(STARTS):
        x = np.zeros(readings.blades + find_level)
        x[: readings.blades] = (start > 0) * spread * rng.standard_normal(readings.blades)
        for part in parts:
            fit = scipy.optimize.least_squares(
                part.left, x, part.slopes, x_scale="jac", bounds=(-0.9, np.inf), max_nfev=100
            )
            x = fit.x
        best = fit if best is None or fit.cost < best.cost else best
        if accepted(misfit(best.fun, beyond := len(best.fun) - len(x)), beyond):
            break
    assert best is not None
    return _identified(best.x, readings.blades, best.fun, best.jac)


@dataclass(eq=False)
class _Readings:
    """Amplitudes (f, w) at frequencies (f,) Hz with their noise, and what was computed last."""

    stuck: Stuck
    frequency: Array
    amplitude: Array
    noise: Array
    find_level: bool
    last: tuple[bytes, tuple[Array, Array]] | None = None

    @classmethod
    def of(
        cls, stuck: Stuck, frequency: ArrayLike, amplitude: ArrayLike, noise: ArrayLike, find_level: bool
    ) -> _Readings:
        f, a = np.asarray(frequency, dtype=float), np.asarray(amplitude, dtype=float)
        w = len(stuck.tuned.whole.outputs)
        if f.ndim != 1 or a.shape != (len(f), w):
            raise UserError(f"amplitude: give one for each of the {w} read-outs, at each of the frequencies")
        sigma = np.broadcast_to(np.asarray(noise, dtype=float), a.shape)
        if not all((np.isfinite(v) & (v > 0)).all() for v in (f, a, sigma)):
            raise UserError("frequency, amplitude, noise: must be positive numbers")
        return cls(stuck, f, a, sigma, find_level)

    @property
    def blades(self) -> int:
        return self.stuck.tuned.sectors

    def calm_first(self) -> list[_Readings]:
        """Readings at two frequencies, four, eight, ..., and all: first those at which they depend on deviations
        least."""
        zero = np.zeros(self.blades + self.find_level)
        size = np.abs(self.slopes(zero)).reshape(*self.amplitude.shape, -1).max(axis=(1, 2))
        order, count = np.argsort(size), len(self.frequency)
        ways = [order[: 2**k] for k in range(1, 20) if 2**k < count] + [order]
        return [replace(self, frequency=self.frequency[w], amplitude=self.amplitude[w], noise=self.noise[w], last=None)
                for w in ways]  # fmt: skip

    def left(self, x: Array) -> Array:
        return self.compared(x)[0]

    def slopes(self, x: Array) -> Array:
        return self.compared(x)[1]

    def compared(self, x: Array) -> tuple[Array, Array]:
        """ln of computed over measured amplitudes, over the noise, and the derivatives."""
        if self.last is None or self.last[0] != x.tobytes():
            both = [self.stuck.amplitudes(f, x[: self.blades]) for f in self.frequency]
            y, slopes = (np.array(v) for v in zip(*both, strict=True))
            rates = (y.conj()[..., None] * slopes).real / np.abs(y[..., None]) ** 2
            rates = np.concatenate([rates, np.ones((*y.shape, int(self.find_level)))], axis=2)
            own = np.log(np.abs(y) / self.amplitude) + (x[self.blades] if self.find_level else 0.0)
            self.last = x.tobytes(), (
                (own / self.noise).ravel(), (rates / self.noise[..., None]).reshape(y.size, -1)
            )  # fmt: skip
        return self.last[1]


def _identified(x: Array, N: int, left: Array, jacobian: Array) -> FromGauges:
    every = covariance(jacobian)
    if every is None:
        raise UserError("amplitude: these do not tell all blades apart; measure at more frequencies")
    beyond = len(left) - len(x)
    level = float(np.exp(x[N])) if len(x) > N else 1.0
    accuracy = level * float(np.sqrt(every[N, N])) if len(x) > N else 0.0
    return FromGauges(x[:N], every[:N, :N], misfit(left, beyond), beyond, level, accuracy)
