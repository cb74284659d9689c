"""How long a vibrating body lasts: Goodman margins and the Haigh diagram from amplitude and mean of the stress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import model_validator

from ..data import Array
from ..settings.numbers import Model, Name, Positive
from .motion import Motion
from .stress import CycleStress, StressPeaks, cycle_stress, places, stress_peaks


class MaterialLimits(Model):
    """What the material bears, of the body whose monitor is drawn."""

    fatigue_strength: Positive
    """[Pa] amplitude that is endured for ever about a zero mean, of the part: size, surface and
    notches that the mesh does not show counted already"""
    tensile_strength: Positive
    """[Pa] ultimate, R_m, where the Goodman line meets zero amplitude"""
    yield_strength: Positive | None = None
    """[Pa] R_p0.2; if given, the largest stress is held against it"""
    name: Name = "material"
    """of the material"""

    @model_validator(mode="after")
    def _in_order(self) -> MaterialLimits:
        if self.fatigue_strength >= self.tensile_strength:
            raise ValueError("fatigue_strength must be below tensile_strength")
        if self.yield_strength is not None and self.yield_strength > self.tensile_strength:
            raise ValueError("yield_strength must not be above tensile_strength")
        return self


def allowed_amplitude(limits: MaterialLimits, mean: Array | float) -> Array:
    """Amplitude (Pa) that is endured at a mean stress (Pa): the Goodman line sigma_W (1 - sigma_m / R_m).

    Tension lowers it; compression is given no credit. Nothing is left from R_m on.
    """
    share = np.clip(np.asarray(mean, dtype=float) / limits.tensile_strength, 0.0, 1.0)
    return limits.fatigue_strength * (1.0 - share)


def vibration_margin(limits: MaterialLimits, amplitude: Array, mean: Array) -> Array:
    """Factor by which the vibration may grow at the mean stress it has: allowed amplitude over amplitude.

    Infinite where nothing vibrates; 0 where the mean alone breaks it.
    """
    allowed = allowed_amplitude(limits, mean)
    ratio = np.full(np.shape(allowed), np.inf)
    return np.divide(allowed, amplitude, out=ratio, where=(np.asarray(amplitude) > 0) | (allowed <= 0))


def proportional_margin(limits: MaterialLimits, amplitude: Array, mean: Array) -> Array:
    """Factor by which amplitude and mean may grow together: 1/n = sigma_a / sigma_W + sigma_m / R_m, tension only."""
    used = np.asarray(amplitude) / limits.fatigue_strength + np.maximum(mean, 0.0) / limits.tensile_strength
    return np.divide(1.0, used, out=np.full(np.shape(used), np.inf), where=used > 0)


@dataclass(frozen=True)
class Endurance:
    """The worst place of a body at one frequency.

    Attributes:
        place: its number among the stress places. point: (3,) m. amplitude, mean, largest: Pa, there, see
            `stress.CycleStress`. vibration, proportional: Goodman margins there, the smallest vibration margin of all
            places. yielding: yield strength over the largest stress of all places, NaN if none is given.
    """

    place: int
    point: Array
    amplitude: float
    mean: float
    largest: float
    vibration: float
    proportional: float
    yielding: float


def endurance(cycle: CycleStress, limits: MaterialLimits, only: Array | None = None) -> Endurance:
    """The place whose vibration may grow least.

    Args:
        only: numbers of the places that count; those outside the singular zones if None.
    """
    chosen = cycle.counted if only is None else np.asarray(only)
    margin = vibration_margin(limits, cycle.amplitude[chosen], cycle.mean[chosen])
    i = int(chosen[margin.argmin()])
    a, m = float(cycle.amplitude[i]), float(cycle.mean[i])
    top = float(cycle.largest[chosen].max())
    return Endurance(
        i, cycle.points[i], a, m, float(cycle.largest[i]), float(margin.min()),
        float(proportional_margin(limits, np.array(a), np.array(m))),
        np.nan if limits.yield_strength is None or top == 0 else limits.yield_strength / top,
    )  # fmt: skip


def worst(motion: Motion, limits: MaterialLimits, location: str = "nodes", only: Array | None = None) -> Endurance:
    """`endurance` at the point of a sweep with the largest stress amplitude, and of the sweep therefore.

    The mean is the static one but for what rectifies in the contacts, so that the largest amplitude decides.
    """
    peaks: StressPeaks = stress_peaks(motion, location, only)
    return endurance(cycle_stress(motion, int(peaks.amplitude.argmax()), location), limits, only)


def away_from(motion: Motion, centres: Array, radius: float, location: str = "nodes") -> Array:
    """Numbers of the stress places farther than `radius` (m) from all of (k, 3) points, m."""
    at, near = places(motion, location), np.zeros(len(places(motion, location)), dtype=bool)
    for centre in np.atleast_2d(centres):
        near |= np.linalg.norm(at - centre, axis=1) < radius
    return np.flatnonzero(~near)
