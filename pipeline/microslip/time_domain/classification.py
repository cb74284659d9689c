"""What motion it is, periodic, quasi-periodic or chaotic: by what comes back, spectrum, and Lyapunov exponent.

The largest Lyapunov exponent is the mean growth of a small separation, by two neighbouring motions of the same stepper,
the separation brought back to its size after every period, with what the contacts remember (G. Benettin, L. Galgani,
A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth dynamical systems, Meccanica 15, 1980).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize
import scipy.special

from ..data import Array
from ..units import counted, percent
from .stepper import MotionState, Stepper

if TYPE_CHECKING:
    from .equations import MotionEquations
    from .orbit import Orbit

APART = 1e-7
"""Separation of the neighbouring motions, a share of the motion's size: far above rounding, far below a roughness."""

FREE = 1e-6
"""Stiffness of a mode, over that of the excitation, below which it counts as without a spring."""

ALIGNED = 20
"""Periods in which the separation finds the direction that grows fastest."""

MOST, FEWEST = 160, 20
"""Periods over which the growth is averaged, and those without which nothing is said."""

BATCHES = 10
"""Means of the growth from which its uncertainty is taken."""

REBOUNDS = 4
"""Impacts of a chatter that comes to rest, at least."""

LINES = 5
"""Combinations k of the second frequency up to which lines are looked for."""

SETTLED = 1e-3
"""Share of its size by which a motion may drift in half of the periods that are kept and have come to rest."""

LATTICE = 0.02
"""Share of the points after every period that may lie off the closed curve of a quasi-periodic motion."""


class Exponent(NamedTuple):
    """The largest Lyapunov exponent and half the width of its 95 % interval, 1/s; periods it was taken from; what a
    reader must know."""

    value: float
    uncertainty: float
    periods: int
    message: str = ""

    @property
    def sign(self) -> int:
        """1 or -1 where zero lies beyond twice the interval, which chance does once in a thousand times; else 0."""
        return int(np.sign(self.value)) if abs(self.value) > 2 * self.uncertainty else 0

    def __str__(self) -> str:
        digits = max(0, 1 - math.floor(math.log10(self.uncertainty))) if self.uncertainty > 0 else 4
        return f"{self.value:.{digits}f} ± {self.uncertainty:.{digits}f} 1/s"


@dataclass(frozen=True)
class Chatter:
    """Rebounds that come to rest. time: s, of the last impact. impacts: with that. flight: s, the one before it, the
    shortest; stays: s, until it leaves; step: s, by which the flights are resolved."""

    time: float
    impacts: int
    flight: float
    stays: float
    step: float


def exponent(stepper: Stepper, now: MotionState, samples: int, each: int, periods: int, seed: int = 0) -> Exponent:
    """The largest Lyapunov exponent along the motion that goes on from a state, over so many periods.

    Args:
        samples: of a period. each: steps of a sample.

    Returns:
        nan where the motion or its neighbour ceases to be finite, or where memory cannot be separated (a message).
    """
    stepper = replace(stepper, order=2)  # whose steps are the same for neighbours
    if unseparable := whole(now.held.states):
        return Exponent(math.nan, math.nan, 0, unseparable)
    e = stepper.equations
    rows, scale = np.full(samples, each * samples), sizes(e, len(now.y))
    weights = scale[:, : scale.shape[1] // 2]
    seen = stepper.run(now, np.full(samples, each))[1]
    swing = np.concatenate([weights.ravel() * np.asarray(seen.q), np.asarray(seen.q_dot)], axis=1)
    apart = APART * (float(np.linalg.norm(swing, axis=1).max()) or 1.0)
    way = np.random.default_rng(seed).standard_normal(scale.shape) / scale
    other = now._replace(y=now.y + apart / np.linalg.norm(scale * way) * way)
    growth = np.zeros(ALIGNED + periods)
    for i in range(len(growth)):
        now, other = stepper.run(now, rows, 1)[0], stepper.run(other, rows, 1)[0]
        size = float(np.linalg.norm(scale * (other.y - now.y)))
        if not 0 < size < math.inf:
            return Exponent(math.nan, math.nan, i, "No Lyapunov exponent: the separation of two motions was lost.")
        growth[i] = math.log(size / apart)
        other = between(now, other, apart / size)
    return mean(growth[ALIGNED:], 2 * np.pi / e.Omega)


def sizes(e: MotionEquations, blocks: int) -> Array:
    """(b, 2 p) by which displacements and velocities of the modes are weighed in a separation, 1/s and 1."""
    weights = pace(e.omega2, e.Omega).reshape(blocks, -1)
    return np.concatenate([weights, np.ones_like(weights)], axis=1)


def pace(omega2: Array, Omega: float) -> Array:
    """(m,) rad/s by which displacements of modes are weighed beside velocities: their own, or that
    of the excitation where no spring holds them."""
    return np.sqrt(np.where(held(omega2, Omega), np.abs(omega2), Omega**2))


def held(omega2: Array, Omega: float) -> Array:
    """(m,) whether a spring holds a mode."""
    return np.asarray(np.abs(omega2) > FREE * Omega**2)


def periods_of(done: int) -> int:
    """Over how many periods the growth is averaged after so many were done; 0: these are too few."""
    periods = min(MOST, done - ALIGNED) // BATCHES * BATCHES
    return periods if periods >= FEWEST else 0


def whole(states: Any) -> str:
    """A message where a contact remembers numbers that two motions cannot be a little apart in."""
    leaves = jax.tree_util.tree_leaves(states)
    if all(jnp.issubdtype(x.dtype, jnp.floating) for x in leaves):
        return ""
    return "No Lyapunov exponent: a law of these contacts remembers whole numbers, which cannot be varied a little."


def between(now: MotionState, other: MotionState, share: Any, array: Callable[[Any], Any] = np.asarray) -> MotionState:
    """A motion apart by a share of what the other is, memory of contacts included. array: of numpy or of jax."""

    def one(a: Any, b: Any) -> Any:
        a, b = array(a), array(b)
        return a + share * (b - a) if jnp.issubdtype(a.dtype, jnp.floating) else a

    return now._replace(
        **{
            key: jax.tree_util.tree_map(one, getattr(now, key), getattr(other, key))
            for key in ("y", "push", "held", "memory")
        }
    )


def mean(growth: Array, period: float) -> Exponent:
    """Of growths a period, with the 95 % interval of Student's t over the means of batches; the first are left out
    where the batches do not take all."""
    n = len(growth) // BATCHES * BATCHES
    means = growth[len(growth) - n :].reshape(BATCHES, -1).mean(axis=1) / period
    spread = scipy.special.stdtrit(BATCHES - 1, 0.975) * means.std(ddof=1) / math.sqrt(BATCHES)
    return Exponent(float(means.mean()), float(spread), n)


def of_body(orbit: Orbit, component: int, at: Array) -> Array:
    """(f, m) coordinates of a component at samples."""
    e = orbit.equations
    counts = [c.at(0).group.n_modes for c in e.assembly.components]
    begin = sum(counts[:component])
    return (e.shapes[begin : begin + counts[component]] @ orbit.q[:, at]).T


def coordinates(orbit: Orbit, contact: int) -> slice:
    """Rows of `Orbit.d` and `Orbit.force` of a contact."""
    begins = np.cumsum([0, *(len(c.tangential) for c in orbit.touching)])
    return slice(int(begins[contact]), int(begins[contact + 1]))


def rubs(orbit: Orbit, contact: int) -> bool:
    """Whether a contact has friction: a force along what moves its points in their plane, and no spring's."""
    tangential, rows = np.array(orbit.touching[contact].tangential), coordinates(orbit, contact)
    force = np.zeros(len(tangential))
    for (F,) in orbit.strips("contact_force"):
        force = np.maximum(force, np.abs(F[rows]).max(axis=1, initial=0.0))
    return bool((force * tangential).max(initial=0.0) > 1e-9 * force.max(initial=0.0))


def second_frequency(orbit: Orbit) -> float:
    """A share rho of the excitation's frequency such that all lines lie at m + k rho, |k| <= `LINES`: the points after
    every period then lie on a closed curve. nan: there is none, or too few periods are kept to tell.

    rho in (0, 1/2), of the strongest line: rho, 1 - rho and so on say the same of the points.
    """
    z = orbit.stroboscopic[0]
    z = z - z.mean(axis=1, keepdims=True)
    n, size = z.shape[1], np.linalg.norm(z)
    if n < 3 * (2 * LINES + 1) or not size:
        return math.nan
    spectrum = np.abs(np.fft.rfft(np.hanning(n) * z, 16 * n)).sum(axis=0)
    rough = np.argmax(spectrum) / (16 * n)

    def left(rho: float) -> float:
        angle = 2 * np.pi * rho * np.outer(np.arange(n), np.arange(1, LINES + 1))
        columns = np.concatenate([np.ones((n, 1)), np.cos(angle), np.sin(angle)], axis=1)
        return float(np.linalg.norm(z.T - columns @ np.linalg.lstsq(columns, z.T, rcond=1e-10)[0]) / size)

    near = rough + np.linspace(-1, 1, 81) / (2 * n)
    best = near[int(np.argmin([left(x) for x in near]))]
    nearest = scipy.optimize.minimize_scalar(left, bounds=(best - 1 / (40 * n), best + 1 / (40 * n)), method="bounded")
    return float(nearest.x) if 0 < nearest.x < 0.5 and nearest.fun < LATTICE else math.nan


def kind(orbit: Orbit) -> str:
    """``periodic``, ``quasi-periodic``, ``chaotic``; ``away``: it comes back but for bodies that
    nothing holds, which go away; ``settling``: it comes back, but drifts, or
    the separation of neighbours shrinks, so that it goes to a motion that comes back; ``run-up``;
    ``open``: it is not known; ``diverged``; ``short``: less than two periods are kept."""
    if math.isfinite(orbit.diverged):
        return "diverged"
    if orbit.run_up:
        return "run-up"
    if len(orbit.time) // orbit.samples < 2:
        return "short"
    if orbit.repeats:
        return "settling" if orbit.drifts > SETTLED else "periodic"
    if orbit.else_repeats:
        return "away"
    if orbit.exponent is None or not math.isfinite(orbit.exponent.value):
        return "open"
    if math.isfinite(second_frequency(orbit)):
        return "open" if orbit.exponent.sign else "quasi-periodic"
    return {1: "chaotic", -1: "settling", 0: "open"}[orbit.exponent.sign]


def said(orbit: Orbit) -> str:
    """What motion it is, in words, and its impacts and slips, those of a period counted apart from it."""
    what, p = kind(orbit), orbit.repeats
    if what == "diverged":
        return f"diverged at {orbit.diverged:.6g} s"
    if what == "run-up":
        return orbit.run_up
    if what == "short":
        return "too short to say whether it repeats"
    kept, inside = len(orbit.time) // orbit.samples, "them" if p > 1 else "it"
    if what == "settling" and p:
        what = "drifting"
    words = {
        "drifting": f"still settles, by {percent(orbit.drifts)} of its size in {counted(kept - kept // 2, 'period')}; "
        f"comes back after {counted(p, 'period')} within 0.1 %",
        "periodic": f"comes back after {counted(p, 'period')}",
        "away": f"goes away from where it was, else comes back after {counted(orbit.else_repeats, 'period')}",
        "chaotic": f"chaotic, largest Lyapunov exponent {orbit.exponent}",
        "quasi-periodic": f"quasi-periodic, second frequency {second_frequency(orbit):.5g} of the excitation's",
        "settling": f"still settles after {kept} periods, largest Lyapunov exponent {orbit.exponent}",
        "open": f"does not come back within {kept // 2} periods",
    }[what]
    if what == "open" and orbit.exponent is not None and math.isfinite(orbit.exponent.value):
        words += f", largest Lyapunov exponent {orbit.exponent}"
    if orbit.impacts or any(c.opens for c in orbit.touching):
        words += f", {_per_period(orbit.impacts, 'impact', p, inside)}"
    return f"{words}, {_per_period(orbit.slips, 'slip', p, inside)}" if orbit.slips else words


def _per_period(rate: float, what: str, p: int, inside: str) -> str:
    if p:
        return f"{counted(round(rate * p), what)} in {inside}"
    return f"{rate:.4g} {what}{'s' * (rate != 1)} a period"


def loops(orbit: Orbit) -> Array:
    """(c,) J a period: area of the loop of force over displacement of every contact coordinate, by the trapezoidal rule
    over the samples of the last periods after which the motion comes back, else over all that are kept."""
    count = (orbit.repeats or len(orbit.time) // orbit.samples - 1) * orbit.samples
    if count <= 0:
        return np.full(len(orbit.d), math.nan)
    F, d = orbit.force[:, -count - 1 :], orbit.d[:, -count - 1 :]
    work = 0.5 * (F[:, 1:] + F[:, :-1]) * np.diff(d, axis=1)
    return work.sum(axis=1) * orbit.samples / count


def lost(orbit: Orbit) -> float:
    """J a period that contacts take for good, counted in every step, over whole repetitions of a motion that comes
    back; nan: less than two periods are kept, or a law does not tell."""
    periods = orbit.repeated(len(orbit.time) // orbit.samples - 1)
    taken = orbit.energy["lost"]
    if periods > 0 and orbit.run_up:
        return float(taken[-1] - taken[0]) / orbit.cycles
    return float(taken[-1] - taken[-1 - periods * orbit.samples]) / periods if periods > 0 else math.nan


def largest_force(orbit: Orbit) -> float:
    """N on any contact."""
    parts = [coordinates(orbit, i) for i in range(len(orbit.touching))]
    return max((float(np.linalg.norm(orbit.force[s][:3], axis=0).max(initial=0.0)) for s in parts), default=0.0)


def chatter(orbit: Orbit, contact: int) -> list[Chatter]:
    """Where rebounds of a contact come to rest: every flight was shorter than the one before, `REBOUNDS` at least, and
    then it stays closed for twice as long as in any of these impacts."""
    closes, opens = orbit.times("closes", contact), orbit.times("opens", contact)
    closes = closes[closes > opens[0]] if len(opens) else closes[:0]
    flights = closes - opens[np.searchsorted(opens, closes) - 1]
    leaves = np.append(opens, orbit.time[-1:])[np.searchsorted(opens, closes)]
    rests, first = list[Chatter](), 0
    for i, (at, stays) in enumerate(zip(closes, leaves - closes, strict=True)):
        if i and flights[i] >= flights[i - 1]:
            first = i
        before = (leaves - closes)[first:i]
        if i - first + 1 >= REBOUNDS and stays > 2 * before.max():
            rests.append(Chatter(float(at), i - first + 1, float(flights[i]), float(stays), orbit.period / orbit.steps))
            first = i + 1
    return rests
