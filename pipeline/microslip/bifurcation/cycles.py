"""Limit cycles born at Hopf points, by harmonic balance with unknown frequency: of systems too large for shooting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.integrate

from ..continuation import NewtonSettings, Settings, branch_off, follow, newton
from ..data import Array, ComplexArray
from ..harmonic_balance.accuracy import SAFETY
from ..progress import Report
from . import equilibria, flow
from .balance import Harmonics, equations, summed
from .branches import LOST
from .diagram import DiagramPlan, diagram
from .dynamics import Dynamics
from .equilibria import Hopf
from .orbits import OFF, extremes
from .shooting import PeriodicOrbit, is_stable

PERIODS = 5
"""Of a motion in time that an orbit is checked by."""

FINE = 1e-9
"""Relative tolerance of that motion."""

MOST = 150
"""Harmonics up to which an orbit is refined."""

FASTEST = 4.0
"""Step times the fastest root up to which the method of order 8 is stable, with room."""

TURNS = np.arange(256) / 256
"""Times in periods at which a motion is held against its orbit."""

EACH = 16
"""Times of a period for each harmonic at which extremes are read, at least."""


@dataclass(frozen=True)
class Checked:
    """An orbit with the harmonics that an accuracy takes, and what time says of it.

    Attributes: orbit. error: see `refined`. drift, swing: of a motion, see `in_time`. multipliers: of Floquet.
    """

    orbit: Harmonics
    error: float
    drift: float
    swing: Array
    multipliers: ComplexArray

    @property
    def stable(self) -> bool:
        return is_stable(self.multipliers)


@dataclass(frozen=True, eq=False)
class Cycles:
    """The orbits born at a Hopf point, from the smallest on.

    Attributes:
        hopf. orbits. ended: why there are no more. system. checked: some of the orbits, by their numbers.
    """

    hopf: Hopf
    orbits: tuple[Harmonics, ...]
    ended: str
    system: Dynamics
    checked: Mapping[int, Checked] = field(default_factory=dict)

    @property
    def supercritical(self) -> bool:
        """Whether orbits are born where the equilibrium is unstable, and as stable as it was."""
        return self.hopf.criticality < 0

    @property
    def lost(self) -> str:
        """Where and why they could not be followed to an end; empty if they were."""
        return f"lost at {self.orbits[-1].p:.4g}: {self.ended}" if self.ended.startswith(LOST) else ""

    @property
    def kind(self) -> str:
        return "supercritical" if self.supercritical else "subcritical"

    @property
    def columns(self) -> dict[str, Array]:
        """Column -> (o,) values: parameter, frequency, half of the way from the smallest to the largest read-out, and
        the share of the highest harmonic in the first; of checked orbits also what time says of them, else NaN."""
        swing = [_swing(self.system.seen(o.at(_turns(o)), o.p)) for o in self.orbits]
        in_time = self._told(lambda c: c.swing, len(self.system.named))
        return {
            "parameter": np.array([o.p for o in self.orbits]),
            "frequency_Hz": np.array([o.omega / (2 * np.pi) for o in self.orbits]),
            **{self.system.column("amplitude", i): y for i, y in enumerate(np.array(swing).T)},
            "highest_harmonic": np.array([self._tail(o) for o in self.orbits]),
            **{self.system.column("in time", i): y for i, y in enumerate(in_time.T)},
            "in_time_leaves_by": self._told(lambda c: c.drift),
            "harmonics": self._told(lambda c: c.orbit.count),
            "estimated_error": self._told(lambda c: c.error),
            "largest_multiplier": self._told(lambda c: np.abs(c.multipliers).max() if len(c.multipliers) else np.nan),
        }

    def _told(self, of: Callable[[Checked], Any], *shape: int) -> Array:
        none = np.full(shape, np.nan)
        return np.array([of(self.checked[i]) if i in self.checked else none for i in range(len(self.orbits))])

    def _tail(self, o: Harmonics) -> float:
        size = np.asarray(self.system.scale)
        return float(np.linalg.norm(o.c[-2:] / size) / np.linalg.norm(o.c[1:3] / size))


def cycles(
    system: Dynamics, x: Array, start: float, stop: float, harmonics: int, band: tuple[float, float], points: int = 40,
    report: Report = lambda _: None,
) -> list[Cycles]:  # fmt: skip
    """The limit cycles of every Hopf point between two values of the parameter.

    Args:
        x: (n,) near an equilibrium at the start. band: rad/s, of the Hopf points that are wanted. points: of a branch.

    Raises:
        UserError: no equilibrium near x.
    """
    still = diagram(system, x, DiagramPlan(start, stop, orbits=False))
    wanted = [h for h in still.hopf if band[0] <= h.omega <= band[1]]
    return [_born_at(system, h, harmonics, (start, stop), points, report) for h in wanted]


def _born_at(
    system: Dynamics, hopf: Hopf, H: int, ends: tuple[float, float], points: int, report: Report
) -> Cycles:  # fmt: skip
    way = np.zeros((2 * H + 1, system.count))
    way[1:3] = hopf.shape.real, -hopf.shape.imag
    way /= np.sqrt(np.mean((way[1:3] / np.asarray(system.scale)) ** 2) * system.count)
    rest = np.zeros_like(way)
    rest[0] = hopf.x
    problem = equations(system, Harmonics(rest + OFF * way, hopf.omega, hopf.p))
    low, high = sorted(ends)
    asked = Settings(low=low, high=high, step=0.02, step_max=0.2, points=points)
    first = branch_off(problem, problem.unknowns(problem.reference), hopf.p, (problem.way(way), 0.0), asked)
    orbits, ended = list[Harmonics](), ""
    for state in follow(problem, first, asked):
        for point in state.found:
            orbit = problem.orbit(point.x, point.lam)
            orbits.append(orbit)
        ended = state.status
        report(f"limit cycle {len(orbits)} of {points}, {state.y[-1] * system.parameter_scale:.6g}")
    return Cycles(hopf, tuple(orbits), ended, system)


def in_time(system: Dynamics, orbit: Harmonics, periods: int = PERIODS) -> tuple[float, Array]:
    """How far a motion in time that begins on an orbit leaves it in some periods, over its largest swing in scales, and
    (w,) half of the way from the smallest to the largest read-out in the last of them."""
    size = np.asarray(system.scale)

    def rate(t: float, y: Array) -> Array:
        return np.asarray(_rate(system)(y * size, orbit.p)) / size

    turns = np.append((np.arange(periods)[:, None] + TURNS).ravel(), periods)
    times = turns * 2 * np.pi / orbit.omega
    motion = orbit.at(turns) / size
    run = scipy.integrate.solve_ivp(
        rate,
        (0.0, times[-1]),
        motion[0],
        method="DOP853",
        t_eval=times,
        rtol=FINE,
        atol=FINE * np.ptp(motion, axis=0).max(),
    )
    if not run.success:
        return float("inf"), np.full(len(system.named), np.nan)
    seen = system.seen(run.y.T[-len(TURNS) :] * size, orbit.p)
    return float(np.abs(run.y.T - motion).max() / (np.ptp(motion, axis=0).max() / 2)), _swing(seen)


def _turns(orbit: Harmonics) -> Array:
    """Times in periods at which its extremes are read."""
    count = max(len(TURNS), EACH * orbit.count)
    return np.arange(count) / count


def _swing(y: Array) -> Array:
    """(w,) half of the way from the smallest to the largest value of a period (s, w)."""
    largest, smallest = extremes(y)
    return 0.5 * (largest - smallest)


def refined(
    system: Dynamics, orbit: Harmonics, accuracy: float, most: int = MOST, report: Report = lambda _: None
) -> tuple[Harmonics, float]:  # fmt: skip
    """An orbit with as many harmonics as its accuracy takes, and its estimated error: shares of its amplitude.

    Harmonics grow by half. What they change falls from one time to the next by a factor, by which what they still miss
    is estimated, times `SAFETY`. With `most` of them it may still be too large;
    it is infinite where the balance was not found again.
    """
    size, before, error = np.asarray(system.scale), 0.0, np.inf
    while error > accuracy and (H := orbit.count + max(orbit.count // 2, 2)) <= most:
        c = np.zeros((2 * H + 1, system.count))
        c[: len(orbit.c)] = orbit.c
        problem = equations(system, replace(orbit, c=c))
        solution = newton(problem, problem.unknowns(problem.reference), orbit.p, NewtonSettings(last_resort=False))
        if not solution.converged:
            return orbit, np.inf
        orbit = problem.orbit(solution.x, orbit.p)
        turns = np.arange(4 * H) / (4 * H)
        y = orbit.at(turns) / size
        change = np.abs(summed(H, turns) @ (orbit.c - c) / size).max() / (np.ptp(y, axis=0).max() / 2)
        error = float(SAFETY * change * (min(1.0, change / before) if before else 1.0))
        before = change
        report(f"{H} harmonics at {orbit.p:.6g}: estimated error {error:.1e}")
    return orbit, error


def cycle_multipliers(system: Dynamics, orbit: Harmonics) -> ComplexArray:
    """Floquet multipliers of an orbit, the largest first, see `PeriodicOrbit.multipliers`.

    Steps of the flow follow the motion, which may be small, and not what leaves it: nodes are so many that a step from
    one to the next is short enough for the fastest root.
    """
    period = 2 * np.pi / orbit.omega
    fastest = np.abs(equilibria.eigenvalues(system, orbit.at(np.zeros(1))[0], orbit.p)).max()
    nodes = flow.BLOCK * int(np.ceil(max(period * fastest / (FASTEST * flow.BLOCK), 1)))
    return PeriodicOrbit(system, orbit.at(np.arange(nodes) / nodes), period, orbit.p).multipliers


def checked(
    system: Dynamics, orbit: Harmonics, accuracy: float | None, report: Report = lambda _: None
) -> Checked:  # fmt: skip
    """An orbit refined to an accuracy, and what time says of it; without one, as it is and by a motion alone."""
    if accuracy is None:
        return Checked(orbit, np.nan, *in_time(system, orbit), np.zeros(0, dtype=complex))
    fine, error = refined(system, orbit, accuracy, report=report)
    return Checked(fine, error, *in_time(system, fine), cycle_multipliers(system, fine))


def _rate(system: Dynamics) -> Any:
    if system not in _COMPILED:
        _COMPILED.clear()
        _COMPILED[system] = jax.jit(lambda x, p: system.rate(x, p, jnp.zeros(())))
    return _COMPILED[system]


_COMPILED: dict[Dynamics, Any] = {}
