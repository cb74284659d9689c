"""Resonances over the engine order, and envelopes of responses over ranges of what is not known exactly.

Sextro Figs. 5.5-2 and 5.4-2. Many responses of one system: each starts where one of its neighbours ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..continuation import CONVERGED
from ..continuation import peak as climbed
from ..data import Array, ComplexArray, Indices, UserError
from ..units import METRES, Quantity
from . import response
from .peak import checked, resonance
from .problem import Problem
from .readout import WithOutput, measured
from .reduced import stuck
from .response import HarmonicResponse
from .solver import Report
from .sweeps import tops

# --- resonance over engine order -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class OverOrders:
    """The largest resonance of every engine order in a band.

    Attributes:
        order: (e,) engine orders. index: (e,) of their waves. frequency: (e,) Hz and amplitude: (e,) m of the first
            read-out; NaN where the band holds no peak. stuck: (e,) Hz, the nearest mode with sticking
            contacts, or NaN. failed: (e,) points that did not converge. quantity: what is read; m stands for its unit.
    """

    order: Indices
    index: Indices
    frequency: Array
    amplitude: Array
    stuck: Array
    failed: Indices
    quantity: Quantity = field(kw_only=True, default=METRES)

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        return {
            "engine_order": self.order.astype(float),
            "wave": self.index.astype(float),
            "resonance_Hz": self.frequency,
            self.quantity.column("amplitude"): self.amplitude,
            "stuck_Hz": self.stuck,
            "failed_points": self.failed.astype(float),
        }


def over_orders(
    build: Callable[[int], Problem], orders: Sequence[int], band: tuple[float, float], points: int = 41,
    report: Report = lambda _: None, under: str = "", keep: Callable[[OverOrders], None] = lambda _: None,
) -> OverOrders:  # fmt: skip
    """The largest resonance of every engine order.

    Args:
        build: engine order -> problem. band: Hz, of the frequency of the order. points: of a sweep over it, from whose
            largest peak the way uphill is followed (`peak`), round folds too. under: words for the report, such as
            the normal force. keep: is given what there is after every engine order.
    """
    rows, whole = list[tuple[Any, ...]](), OverOrders(*6 * (np.zeros(0, dtype=int),))
    for i, e in enumerate(orders):
        report(f"engine order {e}{under}, {i + 1} of {len(orders)}")
        problem = build(int(e))
        f, a, failed = largest(problem, np.linspace(*band, points), report)
        modes = stuck(problem.parts[1][0], problem.stiffness[0]) if len(problem.parts[1]) == 1 else np.zeros(0)
        near = modes[np.abs(modes - f).argmin()] if len(modes) and np.isfinite(f) else np.nan
        rows.append((int(e), problem.assembly.index(1), f, a, near, failed))
        columns = (np.array(column) for column in zip(*rows, strict=True))
        whole = OverOrders(*columns, quantity=measured(problem.assembly))
        what = f"{f:.6g} Hz, {a:.4g} {whole.quantity.said}" if np.isfinite(f) else "no resonance in the band"
        report(f"engine order {e}{under}: {what}")
        keep(whole)
    return whole


def largest(problem: Problem, frequency: Array, report: Report = lambda _: None) -> tuple[float, float, int]:
    """Hz, m and failed points of the largest resonance of a band; NaN where it has no peak."""
    found = response.harmonic_response(problem, frequency, np.zeros(len(problem.assembly.contacts)), report)
    failed, peaks = int((~found.converged).sum()), tops(found)
    if not len(peaks):
        return float("nan"), float("nan"), failed
    i = max(peaks, key=lambda j: abs(found.monitor[j]))
    report(f"peak near {frequency[i]:.6g} Hz")
    top = resonance(checked(problem, climbed(WithOutput(problem, 0), *_near(problem, found, i))))
    if top.status != CONVERGED:
        return float(frequency[i]), float(abs(found.monitor[i])), failed + 1
    return top.Omega / (2 * np.pi), top.amplitude, failed


def _near(problem: Problem, found: HarmonicResponse, i: int) -> tuple[Array, float]:
    """x and Omega near the top about point i: the way uphill from the grid alone would take three times as long."""
    names = ("frequency", "monitor", "converged", "x")
    cut = replace(found, **{name: getattr(found, name)[i - 1 : i + 2] for name in names})
    highest = response.highest(problem, cut, (0, 1, 2))
    assert highest is not None  # a top has one
    return highest[0].x, highest[0].Omega


# --- envelopes -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Envelope:
    """Smallest and largest amplitude over the combinations of what varies.

    Attributes:
        frequency: (f,) Hz. names: of what varies. values: (c, n) of every combination. monitor: (c, f) complex
            amplitudes of the first read-out, m. converged: (c, f). iterations: (c, f) Newton steps. quantity: what is
            read; m stands for its unit.
    """

    frequency: Array
    names: tuple[str, ...]
    values: Array
    monitor: ComplexArray
    converged: Array
    iterations: Array
    quantity: Quantity = field(kw_only=True, default=METRES)

    @property
    def low(self) -> Array:
        """(f,) m; NaN where no combination converged."""
        return self._over(np.fmin)

    @property
    def high(self) -> Array:
        """(f,) m."""
        return self._over(np.fmax)

    def _over(self, pick: np.ufunc) -> Array:
        return pick.reduce(np.where(self.converged, np.abs(self.monitor), np.nan), axis=0)

    @property
    def peaks(self) -> Array:
        """(c,) m, the largest amplitude of every combination on the grid."""
        return np.where(self.converged, np.abs(self.monitor), 0.0).max(axis=1)

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        name = self.quantity.column
        each = {
            name(f"combination_{i + 1}"): np.where(ok, np.abs(a), np.nan)
            for i, (a, ok) in enumerate(zip(self.monitor, self.converged, strict=True))
        }
        return {"frequency_Hz": self.frequency, name("low"): self.low, name("high"): self.high, **each}

    def corners(self) -> dict[str, Array]:
        """Name -> column of a table of the combinations."""
        named = dict(zip(self.names, self.values.T, strict=True))
        failed = (~self.converged).sum(axis=1).astype(float)
        return {
            "combination": 1.0 + np.arange(len(self.values)),
            **named,
            self.quantity.column("peak"): self.peaks,
            "failed_points": failed,
        }


def envelope(
    build: Callable[..., Problem],
    ranges: Mapping[str, Sequence[float]],
    frequency: Array,
    report: Report = lambda _: None,
    keep: Callable[[Envelope], None] = lambda _: None,
) -> Envelope:
    """Responses at all combinations of given values, and what encloses them.

    The combinations are run through so that neighbours differ in one value; each begins where the last one began. A
    friction-damped amplitude need not rise or fall with the friction all along a range: give values in between where
    its smallest one matters.

    Args:
        build: called with one value of each name -> problem; the same number of unknowns each time. ranges: name ->
            values. frequency: (f,) Hz. keep: is given what there is after every combination.

    Raises:
        UserError: a name without a value.
    """
    empty = [name for name, values in ranges.items() if not len(values)]
    if empty:
        raise UserError(f"envelope: {empty[0]}: give one or more values")
    values = list(_snake([list(v) for v in ranges.values()]))
    rows, start, length = [], None, None
    for i, corner in enumerate(values):
        words = ", ".join(f"{name} {value:g}" for name, value in zip(ranges, corner, strict=True))
        report(f"combination {i + 1} of {len(values)}: {words}")
        problem = build(**dict(zip(ranges, corner, strict=True)))
        length = length or problem.length
        problem = replace(problem, length=length)  # one unit for the unknowns of all combinations
        # Starts from the neighbouring combination at every frequency saved a fifth of Newton's steps and no time.
        limit = np.zeros(len(problem.assembly.contacts))
        found = response.harmonic_response(problem, frequency, limit, report, start)
        start = found.x[0] if found.converged[0] else None
        rows.append((found.monitor, found.converged, found.iterations))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        done = np.array(values[: i + 1])
        whole = Envelope(np.asarray(frequency), tuple(ranges), done, *columns, quantity=found.quantity)
        keep(whole)
    return whole


def _snake(values: list[list[float]]) -> Iterator[list[float]]:
    """All combinations, one value changed from one to the next where each list is run through to and fro."""
    if not values:
        yield []
        return
    for i, rest in enumerate(_snake(values[1:])):
        for v in values[0] if i % 2 == 0 else values[0][::-1]:
            yield [v, *rest]
