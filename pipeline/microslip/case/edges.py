"""Where a response still rises at an end of its band, and which range to add to see the resonance beyond."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..data import Array
from ..harmonic_balance import FrequencyResponse
from ..harmonic_balance.sweeps import DIP

OF_THE_HIGHEST = 0.1
"""Share of the highest resonance of a curve (20 dB below it) from which an end that rises is told."""


@dataclass(frozen=True)
class Rising:
    """An end of a band at which a response rises. Attributes: normal_force: N. frequency: Hz, of the end. amplitude: of
    the first read-out there. to: Hz, up to where to look beyond it."""

    normal_force: float
    frequency: float
    amplitude: float
    to: float

    @property
    def add(self) -> str:
        """The range to add, in words."""
        return "{:.6g} to {:.6g} Hz".format(*sorted((self.frequency, self.to)))


def rising(
    responses: Mapping[float, FrequencyResponse], resonances: Mapping[float, Sequence[tuple[float, float]]]
) -> list[Rising]:
    """The ends at which curves rise outwards, by normal force (N).

    An end counts where the response falls by more than `sweeps.DIP` on the way in before it is as high again (half the
    prominence of a resonance that the end cuts off), to no less than `OF_THE_HIGHEST` of the curve's resonances.

    Args:
        resonances: normal force -> (Hz, amplitude) of those that were found.
    """
    found = []
    for normal, r in responses.items():
        ok = r.converged
        f, a = r.frequency[ok], np.abs(r.monitor[ok])
        if len(f) < 2:
            continue
        peaks = resonances.get(normal, ())
        least = OF_THE_HIGHEST * max((height for _, height in peaks), default=0.0)
        for way in (slice(None, None, -1), slice(None)):
            last = sorted(f[way][-2:])
            inside = any(last[0] < at < last[1] for at, _ in peaks)  # what it rises to
            if not inside and a[way][-1] >= least and _rises(a[way]):
                found.append(Rising(normal, float(f[way][-1]), float(a[way][-1]), _beyond(f[way], a[way])))
    return found


def _rises(a: Array) -> bool:
    """Whether amplitudes in the order of the way out rise at its end, and not by a ripple."""
    higher = np.flatnonzero(a >= a[-1])[:-1]
    inside = a[higher[-1] + 1 :] if len(higher) else a
    return bool(a[-1] > a[-2] and inside.min() < (1 - DIP) * a[-1])


def _beyond(f: Array, a: Array) -> float:
    """Hz as far beyond the resonance outside as that is away, which a line through 1 / a over f^2 tells.

    That is the response a = c / |f_0^2 - f^2| of a single mode; damping bends it so that f_0 is found too far out.
    """
    near = int(np.flatnonzero(a < a[-1] / 1.1)[-1]) if (a < a[-1] / 1.1).any() else 0
    near, end, band = min(near, len(f) - 2), float(f[-1]), float(abs(f[-1] - f[0]))
    slope = (1 / a[-1] - 1 / a[near]) / (end**2 - f[near] ** 2)
    square = end**2 - 1 / (a[-1] * slope)
    away = abs(np.sqrt(max(square, 0.0)) - end)
    least = 4 * float(np.abs(np.diff(f)).min())
    if end > f[0]:
        return _rounded(end + max(least, min(2 * away, max(band, 1.2 * away), end)), up=True)
    return _rounded(end - max(min(least, 0.5 * end), min(2 * away, 0.5 * end)), up=False)


def _rounded(f: float, up: bool) -> float:
    """Three digits, outwards."""
    unit = 10.0 ** (np.floor(np.log10(f)) - 2)
    return float((np.ceil if up else np.floor)(f / unit) * unit)


def messages(found: Sequence[Rising]) -> list[str]:
    """A sentence for each end that says what to add."""
    said = []
    for end in sorted({(one.to > one.frequency, one.frequency) for one in found}):
        those = [one for one in found if (one.to > one.frequency, one.frequency) == end]
        far = max(those, key=lambda one: abs(one.to - one.frequency))
        key = "stop" if end[0] else "start"
        forces = ", ".join(f"{one.normal_force:g}" for one in those)
        said.append(
            f"At F_N = {forces} N the response still rises at {end[1]:.6g} Hz, an end of the band: a resonance may lie "
            f"beyond, which no table shows; add {far.add} (sweep.{key} = {far.to:.6g})."
        )
    return said
