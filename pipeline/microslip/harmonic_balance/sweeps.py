"""A sweep over frequency: what it holds, and where its resonances are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np

from ..data import Array, Indices, largest
from ..results.series import of_solutions
from ..units import METRES, Quantity


@dataclass(frozen=True)
class FrequencyResponse:
    """Response over frequency.

    Attributes:
        frequency: (f,) Hz. monitor: (f,) complex 0-peak displacement of the monitored row, m.
        slip: (f, c) complex 0-peak displacement of each slider, m. dissipated: (f,) energy per cycle, J.
        converged: (f,) bool.
        quantity: what the monitored row measures; m stands for its unit.
        supplied: (f,) work of the excitation, damped: (f,) loss in the bodies' own damping, J per cycle.
        balance, counted, motion: (f,), see `results.checks.Checks`. All of these are empty where nothing is in contact.
        added: (f,) bool, points between those asked for, see `hidden`; empty: none.
    """

    frequency: Array
    monitor: Array
    slip: Array
    dissipated: Array
    converged: Array
    _: KW_ONLY
    quantity: Quantity = METRES
    supplied: Array = field(default_factory=partial(np.zeros, 0))
    damped: Array = field(default_factory=partial(np.zeros, 0))
    balance: Array = field(default_factory=partial(np.zeros, 0))
    counted: Array = field(default_factory=partial(np.zeros, 0))
    motion: Array = field(default_factory=partial(np.zeros, 0))
    added: Array = field(default_factory=partial(np.zeros, 0, dtype=bool))

    @property
    def asked(self) -> Array:
        """(f,) bool, points of the sweep itself."""
        return ~self.added if len(self.added) else np.ones(len(self.frequency), dtype=bool)

    def columns(self) -> dict[str, Array]:
        """What stands in a table beside the frequency, by name and unit; nan where a point is no solution."""
        table = {
            self.quantity.column("amplitude"): np.abs(self.monitor),
            "phase_rad": np.angle(self.monitor),
            "dissipated_J": self.dissipated,
            **({"supplied_J": self.supplied, "damped_J": self.damped} if len(self.supplied) else {}),
        }
        return of_solutions(table, self.converged) | {"converged": self.converged.astype(float)}


def peaks(response: FrequencyResponse) -> list[tuple[float, float]]:
    """(frequency in Hz, amplitude in m) of every local maximum of the monitored amplitude among converged points."""
    a = np.abs(response.monitor)
    return [(float(response.frequency[i]), float(a[i])) for i in tops(response)]


def tops(response: FrequencyResponse) -> Indices:
    """Points of the local maxima that `peaks` lists."""
    good = np.flatnonzero(response.converged)
    a = np.abs(response.monitor[good])
    return good[1:-1][(a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])]


def brackets(response: FrequencyResponse) -> list[tuple[int, int, int]]:
    """Points (low, top, high) between which a sweep may have a peak: about its tops, and from an end at which it is
    higher than beside it inwards, for the peak may lie just inside. Points that did not converge are passed over."""
    good = np.flatnonzero(response.converged)
    where = np.searchsorted(good, tops(response))
    triples = [(int(good[i - 1]), int(good[i]), int(good[i + 1])) for i in where]
    a, last = np.where(response.converged, np.abs(response.monitor), 0.0), len(response.frequency) - 1
    ends = [(0, 0, 1), (last - 1, last, last)] if last > 0 else []
    inside = ((end, high if end == low else low) for low, end, high in ends)
    rise = [0 < a[beside] < a[end] for end, beside in inside]
    return triples + [end for end, rises in zip(ends, rise, strict=True) if rises]


STILL = 1e-10
"""Share of the contacts' motion below which a read-out counts as one that does not move: rounding."""


def still(response: FrequencyResponse) -> bool:
    """Whether nothing moves the first read-out, so that its peaks are none."""
    ok = response.converged
    return bool(ok.any()) and largest(response.monitor[ok]) <= STILL * largest(response.slip[ok])


def hidden(frequency: Array, modes: Array, damping: Array) -> list[float]:
    """Hz of resonances that a sweep may step over: of modes inside the band whose half-power width is less than a step.

    Args:
        frequency: (f,) Hz, rising. modes: (m,) Hz, with sticking contacts or without contacts: where these dissipate
            most, between both, no resonance is as narrow. damping: (m,) their ratios.
    """
    in_band = (modes > frequency[0]) & (modes < frequency[-1])
    modes, damping = modes[in_band], damping[in_band]
    below, above = (frequency[np.searchsorted(frequency, modes) + i] for i in (-1, 0))
    apart = np.minimum(modes - below, above - modes) > ONE * modes
    between = np.sort(modes[apart & (2 * damping * modes < above - below)])
    return between[np.diff(between, prepend=0.0) > ONE * between].tolist()


ONE = 1e-9
"""Relative distance of two modes up to which they are one frequency, as those of a ring's waves that run both ways."""


def inside(
    response: FrequencyResponse, bracket: tuple[int, int, int], peak: float, amplitude: Callable[[float], float]
) -> bool:
    """Whether what was found between three points is a peak, and no flank or ripple of an end of the band: the response
    is lower by `DIP` at that end, or as far beyond it as the points are apart.

    Args:
        amplitude: m, at another frequency (Hz).
    """
    low, top, high = bracket
    if low < top < high:
        return True
    f, end = response.frequency, float(abs(response.monitor[top]))
    beyond = max(2 * f[top] - f[low if top == high else high], 0.5 * f[top])
    return end < (1 - 1e-9) * peak and min(end, amplitude(float(beyond))) < (1 - DIP) * peak


def overhanging(response: FrequencyResponse, peaks: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Peaks (Hz, m) that do not lie beside a top of the sweep that led to them: the curve turns back between, and has
    other motions at the same frequency, on which the sweep came along."""
    f, a = response.frequency, np.where(response.converged, np.abs(response.monitor), 0.0)
    highest = {top for _, top, _ in brackets(response)}
    over = []
    for at, height in peaks:
        j = int(np.clip(np.searchsorted(f, at), 1, len(f) - 1))
        if not {j - 1, j} & highest and max(a[j - 1], a[j]) < (1 - DIP) * height:
            over.append((at, height))
    return over


def ends(response: FrequencyResponse, peaks: Sequence[tuple[float, float]]) -> list[bool]:
    """Of peaks (Hz, m) whether each is no maximum but where the curve of solutions ends, at a fold: the last solution
    is beside it and no lower, or there is none."""
    f, a, ok, near = response.frequency, np.abs(response.monitor), response.converged, NEAR * _step(response)
    last = np.zeros(len(f), dtype=bool)
    for low, high in _breaks(response):
        last[[low, high]] = True
    return [
        bool((last & (np.abs(f - at) < near) & (~ok | (a >= (1 - 1e-6) * height))).any()) for at, height in peaks
    ]


def gaps(response: FrequencyResponse, peaks: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Hz, Hz: where a sweep jumps or leaves points without a solution, and between an overhanging peak and the place
    where the sweep passes it; those within three steps of each other are one."""
    f, step = response.frequency, _step(response)
    breaks = [(float(f[low]), float(f[high])) for low, high in _breaks(response)]
    jumps = [0.5 * (low + high) for low, high in breaks]
    over = [(at, min(jumps, key=lambda jump: abs(jump - at), default=at)) for at, _ in overhanging(response, peaks)]
    joined = list[tuple[float, float]]()
    for low, high in sorted([*breaks, *(tuple(sorted(one)) for one in over)]):
        if joined and low - joined[-1][1] < 3 * step:
            joined[-1] = joined[-1][0], max(high, joined[-1][1])
        else:
            joined.append((low, high))
    return joined


def _breaks(response: FrequencyResponse) -> list[tuple[int, int]]:
    """Neighbouring points between which a sweep jumps, or of which one is no solution."""
    f, a, ok = response.frequency, np.abs(response.monitor), response.converged
    added = ~response.asked[:-1] & ~response.asked[1:]  # where the last solutions on both sides were looked for
    close = added & (np.diff(f) < NEAR * _step(response))
    apart = np.abs(np.diff(a)) > JUMP * np.maximum(a[:-1], a[1:])
    return [(int(i), int(i) + 1) for i in np.flatnonzero(~ok[:-1] | ~ok[1:] | close & apart)]


def _step(response: FrequencyResponse) -> float:
    """Hz between the points asked for."""
    asked = response.frequency[response.asked]
    return float(np.median(np.diff(asked))) if len(asked) > 1 else 0.0


NEAR, JUMP = 0.02, 0.05
"""Share of a step within which two points are one place, and of the larger amplitude by which they differ where a sweep
jumps there."""

DIP = 0.01
"""Share of the lower one of two tops by which the response has to fall between them for them to be two resonances: the
1 % of amplitude (2 % of its square) that also ends the climb to a followed peak, `continuation.extremum.DIP`. Contacts
that switch point by point and sample by sample ripple a plateau by less."""


def prominent(height: Array, candidates: Indices) -> Indices:
    """Those of some tops of a curve that stand for one resonance each: of tops with less than `DIP` between them the
    highest, the topographic prominence of the others being less than that.

    Args:
        height: (f,) along the curve, all known. candidates: numbers of tops, rising.
    """
    kept: list[int] = []
    for i in map(int, candidates):
        while kept and height[kept[-1] : i + 1].min() > (1 - DIP) * min(height[kept[-1]], height[i]):
            if height[kept[-1]] >= height[i]:
                break
            kept.pop()
        else:
            kept.append(i)
    return np.array(kept, dtype=int)


P = TypeVar("P", bound=tuple[Any, ...])


def resonances(response: FrequencyResponse, found: Sequence[P]) -> list[P]:
    """Of peaks (Hz, m, ...) found between the points of a sweep those that are one resonance each, see `prominent`."""
    grid, ok = response.frequency, response.converged
    f = np.concatenate([grid[ok], [one[0] for one in found]])
    height = np.concatenate([np.abs(response.monitor)[ok], [one[1] for one in found]])
    order = np.argsort(f, kind="stable")
    at = np.flatnonzero(order >= np.count_nonzero(ok))
    kept = prominent(height[order], at)
    return [found[i] for i in order[kept] - np.count_nonzero(ok)]
