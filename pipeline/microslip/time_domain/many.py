"""Many starts of one system, integrated by one compiled program: which motion does each of them reach?

Starts are taken one after the other by one program, each with steps of its own, so that what one start becomes does not
hang on the others. Nothing is kept of a motion but its points after every period and its impacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import program
from ..data import Array
from ..errors import UserError
from ..interrupts import look
from . import loop
from .bodies import Bodies, Now, Options
from .contacts import Group
from .equations import Equations
from .orbit import REPEATS, comes_back, steps_of_a_sample
from .stepper import Stepper

OPEN, DIVERGED = -1, -2
"""In the place of the number of an attractor: it does not come back within half of the periods kept, or is infinite."""


@dataclass(frozen=True, eq=False)
class Reached:
    """What starts lead to.

    Attributes:
        equations. steps: of a period. q, v: (n, keep, m) modal coordinates and velocities after every period that was
            kept. closes: (n,) impacts of all contacts in them.
    """

    equations: Equations
    steps: int
    q: Array
    v: Array
    closes: Array

    def __repr__(self) -> str:
        found = [f"{int((self.attractor == i).sum())} {self._told(i)}" for i in np.unique(self.attractor)]
        return f"<Reached: {len(self.q)} starts; {'; '.join(found)}>"

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
    def impacts(self) -> Array:
        """(n,) of all contacts per period."""
        return self.closes / self.q.shape[1]

    @cached_property
    def points(self) -> Array:
        """(n, 2 m, keep) displacements times their frequencies, and velocities, m kg^1/2 / s."""
        z = np.concatenate([self.q * np.sqrt(np.abs(self.equations.omega2)), self.v], axis=2)
        return z.transpose(0, 2, 1)

    @cached_property
    def size(self) -> float:
        """The largest of them that is finite."""
        return float(np.abs(self.points[np.isfinite(self.points)]).max(initial=0.0))

    @cached_property
    def repeats(self) -> Array:
        """(n,) periods of the excitation after which a motion comes back; 0: it does not."""
        return np.array([comes_back(z, self.size) if np.isfinite(z).all() else 0 for z in self.points], dtype=int)

    @cached_property
    def attractor(self) -> Array:
        """(n,) number of the periodic motion that a start has reached, from 0 in the order of the starts: two are one
        if their points after a period coincide as closely as a motion with itself. Below zero: `OPEN`, `DIVERGED`."""
        found, known = np.full(len(self.points), OPEN), list[Array]()
        for i, (z, p) in enumerate(zip(self.points, self.repeats, strict=True)):
            if not np.isfinite(z).all():
                found[i] = DIVERGED
            elif p:
                near = [np.abs(one - z[:, -1:]).max(axis=0).min() <= 2 * REPEATS * self.size for one in known]
                found[i] = near.index(True) if any(near) else len(known)
                if not any(near):
                    known.append(z[:, -p:])
        return found


def run(e: Equations, x: Array, x_dot: Array, settle: int, keep: int, steps: int | None = None) -> Reached:
    """What starts (n, m0) of the assembly's coordinates lead to; contacts come there on a straight way from u = 0.

    Raises:
        UserError: starts of other lengths than the assembly has coordinates; see `orbit.run`.
    """
    x, x_dot = np.atleast_2d(x).astype(float), np.atleast_2d(x_dot).astype(float)
    if x.shape != x_dot.shape or x.shape[1] != len(e.shapes):
        raise UserError(
            f"starts: displacements {x.shape} and velocities {x_dot.shape} must both be (n, {len(e.shapes)}), a column "
            "for each coordinate of the system"
        )
    each = steps_of_a_sample(e, 1, steps)
    stepper = Stepper(e, 2 * np.pi / e.Omega / each, accounts=False)
    to_modes = e.shapes.T @ e.assembly.joined(1).M.real
    shape = (len(x), stepper.bodies.omega2.shape[0], -1)
    y = np.concatenate([(x @ to_modes.T).reshape(shape), (x_dot @ to_modes.T).reshape(shape)], axis=2)
    counts = np.array([settle * each, each]) * 2**stepper.options.halvings
    ends, closes = np.zeros((len(x), keep, *y.shape[1:])), np.zeros(len(x), int)
    for i, start in enumerate(y):
        look()
        o = e.oscillators(0.0)
        ends[i], closes[i] = _one(stepper.options, keep, stepper.groups, stepper.bodies, start, o, counts)
    q, v = (part.reshape(len(x), keep, -1) for part in np.split(ends, 2, axis=3))
    return Reached(e, each, q, v, closes)


@partial(program, static_argnums=(0, 1))
def _one(
    options: Options, keep: int, groups: tuple[Group, ...], B: Bodies, y: Any, o: Any, counts: Any
) -> tuple[Any, Any]:
    """(keep, b, 2 p) after every period that is kept, and how many impacts were in them."""

    def step(carried: tuple) -> tuple:
        left, now, closes = carried
        left, now = loop.one_step(options, groups, B, left, now)
        return left, now, closes + jnp.sum(now.met[0])

    def on(now: Now, count: Any) -> tuple[Now, tuple[Any, Any]]:
        """Further; o is there again what it was, so that rounding does not add up."""
        _, after, closes = jax.lax.while_loop(lambda c: c[0] > 0, step, (count, now, jnp.zeros((), int)))
        return after._replace(o=now.o), (after.y, closes)

    now, _ = on(loop.begun(options, groups, B, y, o, None), counts[0])
    _, (ends, closes) = jax.lax.scan(lambda n, _: on(n, counts[1]), now, length=keep)
    return ends, jnp.sum(closes)
