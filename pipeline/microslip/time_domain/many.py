"""Many starts of one system, integrated by one compiled program: which motion does each of them reach?

Starts are taken one after the other by one program, each with steps of its own, so that what one start becomes does not
hang on the others. Nothing is kept of a motion but its points after every period and its impacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array
from ..errors import UserError
from ..interrupts import look
from ..programs import program
from . import classification, loop
from .bodies import Bodies, MotionState, Options
from .classification import Exponent
from .equations import MotionEquations
from .orbit import REPEATS, comes_back, refuse_behind, steps_of_a_sample
from .stepper import Stepper

OPEN, DIVERGED = -1, -2
"""In the place of the number of an attractor: it does not come back within half of the periods kept, or is infinite."""


@dataclass(frozen=True, eq=False)
class Reached:
    """What starts lead to.

    Attributes:
        equations. steps: of a period. q, v: (n, keep, m) modal coordinates and velocities after every period that was
            kept. closes: (n,) impacts of all contacts in them. exponents: the largest Lyapunov exponent of each, if
            they were asked for; nan where a motion ceases to be finite.
    """

    equations: MotionEquations
    steps: int
    q: Array
    v: Array
    closes: Array
    exponents: tuple[Exponent, ...] = ()

    def __repr__(self) -> str:
        counts = [f"{int((self.attractor == i).sum())} {self._told(i)}" for i in np.unique(self.attractor)]
        return f"<Reached: {len(self.q)} starts; {'; '.join(counts)}>"

    def _told(self, attractor: int) -> str:
        if attractor < 0:
            return "diverge" if attractor == DIVERGED else "do not come back"
        return f"to attractor {attractor} of period {self.repeats[np.argmax(self.attractor == attractor)]}"

    @property
    def y(self) -> Array:
        """(n, keep, w) read-outs after every period, in their units; without what bodies yield beside their modes."""
        o = self.equations.oscillators(0.0)
        return self.q @ self.equations.output.T + self.equations.output_given @ o

    @property
    def y_dot(self) -> Array:
        """(n, keep, w) velocities of the read-outs then, in their units a second; likewise."""
        e = self.equations
        return self.v @ e.output.T + e.output_given @ (e.turning @ e.oscillators(0.0))

    @property
    def impacts(self) -> Array:
        """(n,) of all contacts per period."""
        return self.closes / self.q.shape[1]

    @cached_property
    def points(self) -> Array:
        """(n, 2 m, keep) displacements times their frequencies, and velocities, m kg^1/2 / s."""
        e = self.equations
        z = np.concatenate([self.q * classification.pace(e.omega2, e.Omega), self.v], axis=2)
        return z.transpose(0, 2, 1)

    @cached_property
    def size(self) -> float:
        """The largest of them that is finite, but for places of bodies that nothing holds."""
        held = classification.held(self.equations.omega2, self.equations.Omega)
        z = np.abs(self.points[:, np.append(held, np.ones_like(held))])
        return float(z[np.isfinite(z)].max(initial=0.0))

    @cached_property
    def repeats(self) -> Array:
        """(n,) periods of the excitation after which a motion comes back; 0: it does not."""
        return np.array([comes_back(z, self.size) if np.isfinite(z).all() else 0 for z in self.points], dtype=int)

    @cached_property
    def attractor(self) -> Array:
        """(n,) number of the periodic motion that a start has reached, from 0 in the order of the starts: two are one
        if their points after a period coincide as closely as a motion with itself. Below zero: `OPEN`, `DIVERGED`."""
        numbers, orbits = np.full(len(self.points), OPEN), list[Array]()
        for i, (z, p) in enumerate(zip(self.points, self.repeats, strict=True)):
            if not np.isfinite(z).all():
                numbers[i] = DIVERGED
            elif p:
                near = [np.abs(orbit - z[:, -1:]).max(axis=0).min() <= 2 * REPEATS * self.size for orbit in orbits]
                numbers[i] = near.index(True) if any(near) else len(orbits)
                if not any(near):
                    orbits.append(z[:, -p:])
        return numbers


def run(
    e: MotionEquations,
    x: Array,
    x_dot: Array,
    settle: int,
    keep: int,
    steps: int | None = None,
    exponents: bool = False,
) -> Reached:
    """What starts (n, m0) of the assembly's coordinates lead to; contacts come there on a straight way from u = 0.

    Args:
        exponents: follow a neighbour of each motion too, see `classification.exponent`.

    Raises:
        UserError: starts of other lengths than the assembly has coordinates, or behind what is
        rigid; see `orbit.run`.
    """
    x, x_dot = np.atleast_2d(x).astype(float), np.atleast_2d(x_dot).astype(float)
    if x.shape != x_dot.shape or x.shape[1] != len(e.shapes):
        raise UserError(
            f"starts: displacements {x.shape} and velocities {x_dot.shape} must both be (n, {len(e.shapes)}), a column "
            "for each coordinate of the system"
        )
    to_modes = e.shapes.T @ e.assembly.joined(1).M.real
    for place in x:
        refuse_behind(e, to_modes @ place)
    periods = classification.periods_of(settle + keep) if exponents else 0
    if exponents and not periods:
        least = classification.ALIGNED + classification.FEWEST
        raise UserError(f"exponents: take {least} periods at least; settle and keep are {settle + keep} together")
    each = steps_of_a_sample(e, 1, steps)
    stepper = Stepper(e, 2 * np.pi / e.Omega / each, accounts=False)
    shape = (len(x), stepper.bodies.omega2.shape[0], -1)
    y = np.concatenate([(x @ to_modes.T).reshape(shape), (x_dot @ to_modes.T).reshape(shape)], axis=2)
    counts = np.array([settle * each, each]) * 2**stepper.options.halvings
    ends, closes, last = np.zeros((len(x), keep, *y.shape[1:])), np.zeros(len(x), int), list[MotionState]()
    for i, start in enumerate(y):
        look()
        o = e.oscillators(0.0)
        ends[i], closes[i], now = _one(stepper.options, keep, stepper.bodies, start, o, counts)
        last.append(now)
    q, v = (part.reshape(len(x), keep, -1) for part in np.split(ends, 2, axis=3))
    reached = Reached(e, each, q, v, closes)
    return replace(reached, exponents=_exponents(stepper, last, reached.size, each, periods)) if periods else reached


def _exponents(
    stepper: Stepper, last: Sequence[MotionState], size: float, each: int, periods: int
) -> tuple[Exponent, ...]:
    """Of the motions that go on from where they are, `last`."""
    if unseparable := classification.whole(last[0].held.states):
        raise UserError(f"exponents: {unseparable}")
    e, stepper = stepper.equations, replace(stepper, order=2)
    scale = classification.sizes(e, last[0].y.shape[0])
    way = np.random.default_rng(0).standard_normal(scale.shape) / scale
    way *= classification.APART * size / np.linalg.norm(scale * way)
    exponents = list[Exponent]()
    for now in last:
        look()
        count = classification.ALIGNED + periods
        growths = _grown(stepper.options, count, stepper.bodies, now, each, scale, way)
        growth = np.asarray(growths)[classification.ALIGNED :]
        finite = np.isfinite(growth).all()
        none = Exponent(float("nan"), float("nan"), 0)
        exponents.append(classification.mean(growth, 2 * np.pi / e.Omega) if finite else none)
    return tuple(exponents)


@partial(program, static_argnums=(0, 1))
def _one(options: Options, keep: int, B: Bodies, y: Any, o: Any, counts: Any) -> tuple[Any, Any, MotionState]:
    """(keep, b, 2 p) after every period that is kept, how many impacts were in them, and where the motion is then."""
    on = partial(_further, options, B)
    now, _ = on(loop.begun(options, B, y, o, None), counts[0])

    def period(now: MotionState, _: None) -> tuple[MotionState, tuple[Any, Any]]:
        now, closes = on(now, counts[1])
        return now, (now.y, closes)

    now, (ends, closes) = jax.lax.scan(period, now, length=keep)
    return ends, jnp.sum(closes), now


def _further(options: Options, B: Bodies, now: MotionState, count: Any) -> tuple[MotionState, Any]:
    """So many steps, and the impacts in them; o is there again what it was, so that rounding does not add up."""

    def step(carried: tuple) -> tuple:
        left, now, closes = carried
        left, now = loop.one_step(options, B, left, now)
        return left, now, closes + jnp.sum(now.met[0])

    _, after, closes = jax.lax.while_loop(lambda c: c[0] > 0, step, (count, now, jnp.zeros((), int)))
    return after._replace(o=now.o), closes


@partial(program, static_argnums=(0, 1))
def _grown(
    options: Options,
    periods: int,
    B: Bodies,
    last: MotionState,
    count: Any,
    scale: Any,
    way: Any,
) -> Any:
    """(periods,) logarithms by which a separation grows in each, brought back to its size after every one."""
    apart = jnp.linalg.norm(scale * way)

    def period(carried: tuple[MotionState, MotionState], _: None) -> tuple[tuple[MotionState, MotionState], Any]:
        now, other = (_further(options, B, one, count)[0] for one in carried)
        size = jnp.linalg.norm(scale * (other.y - now.y))
        other = loop.typed(classification.between(now, other, apart / size, jnp.asarray))
        return (now, other), jnp.log(size / apart)

    return jax.lax.scan(period, (last, last._replace(y=last.y + way)), length=periods)[1]
