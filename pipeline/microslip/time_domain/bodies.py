"""What the compiled loop reads of the bodies, and what it carries from step to step.

A blade of a ring moves by modes of its own. What is not zero of each point's row stands together, with the points last,
so that a product is done side by side for all of them (`Spots`): of 24 blades a twelfth of the numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array
from .contacts import Braking, ContactGroup, Held, Yielding, times
from .flow import BodyFlow
from .inclusion import Meets
from .ramp import Ramp

SPARSE = 4
"""Times fewer modes than there are have to move each point, lest gathering them costs more than it saves."""


class Spots(NamedTuple):
    """Of n points. Where all modes move all points, s = m, columns and back are None.

    Attributes:
        D: (s, 3, n), or (3 n, m) of all modes. columns: (s, n) modes that move each point. back: (l, m) where in the
            (s n,) shares of the points those of each mode stand, s n: in none. D_o: (j, 3, n) by the loads' harmonics.
            rest: (3, n) m where d = 0.
    """

    D: Any
    columns: Any
    back: Any
    D_o: Any
    rest: Any


class Bodies(NamedTuple):
    """What the loop reads of the equations, as jax arrays in blocks of modes.

    Attributes:
        groups: of contacts. flow. yielding: see `contacts`. meets: of set-valued points, None: there are none.
            braking: of friction that follows the velocity alone, None: there is none. F_0: (c,). D: (c, m) and
            D_o (c, n): d of the contact coordinates. rate: (n, n) o' over o. kick: (m, c) velocities per force.
        omega2: (b, p). steady: (b, 2 p, n) of the periodic motion without contacts. reach: (points,) norm of their
            motion by modes, and m/s of the steady motion at most; bends: the same of how their velocities change,
            1/s and m/s2: see `loop`. loads: (b, p, n) modal
            forces of o that kick, of a run-up. enough: see `fourth`. harmonics: (H,) rad/s of the loads. spots: of
            `fourth`, group by group, see there; preload: (m,) accelerations by F_0.
    """

    groups: tuple[ContactGroup, ...]
    flow: BodyFlow
    yielding: Yielding | None
    meets: Meets | None
    braking: Braking | None
    F_0: Any
    D: Any
    D_o: Any
    rate: Any
    omega2: Any
    steady: Any
    reach: tuple[Any, Any]
    bends: tuple[Any, Any]
    loads: Any
    kick: Any
    enough: Any
    harmonics: Any
    spots: tuple[Spots, ...]
    preload: Any


class MotionState(NamedTuple):
    """Where the motion is.

    Attributes:
        y: (b, 2 p) modal displacements and velocities. o: (n,). push: (b, p) accelerations by contacts. held: by
            them.
        energy: (6,) J since the start: given by loads, taken by dampers, done on contacts, lost there for good, what
            contacts store now, and what moving ground gave them. worst: m, the largest residual of an implicit contact.
        met: (4, contacts) the events of the last step, at: when, s. memory: of `fourth`, what the laws' differential
            equations remember (k, n) and its rate, group by group, and how the accelerations were bent.
            level: (2,) of `fourth`, k of the next step's 2^k, and of the first one's after a leap.
        missed: m kg^1/2 / s, all that steps have missed so far, as they reckon it themselves.
    """

    y: Any
    o: Any
    time: Any
    push: Any
    held: Held
    energy: Any
    worst: Any
    met: Any
    at: Any
    memory: Any
    level: Any
    missed: Any


class Hardest(NamedTuple):
    """The period in which steps missed most: how much, see `MotionState`, and when it began, s."""

    missed: Any
    time: Any


class Listed(NamedTuple):
    """Events. count: of them. rows: (EVENTS, 3): time in s, contact, kind."""

    count: Any
    rows: Any


class Snapshot(NamedTuple):
    """A sample: (m,) q and q', (c,) d and force, (6,) energies (see `MotionState`) and the bodies' own, J; time, s."""

    q: Any
    q_dot: Any
    d: Any
    force: Any
    energy: Any
    mechanical: Any
    time: Any


@dataclass(frozen=True)
class Options:
    """What the loop is compiled for. leaps: over flights without contact. accounts: of the energy that contacts store
    and lose. ramp: o is that of a run-up, with these harmonics, whose loads kick. halvings: of the step, where it is
    of fourth order; 0: it is of second."""

    leaps: bool
    accounts: bool
    ramp: tuple[Ramp, tuple[int, ...]] | None = None
    halvings: int = 0


def by_force(B: Bodies, force: Any) -> Any:
    """(b, p) m/s2 of the modes by forces (c,) of the contact coordinates."""
    return times(B.kick, force - B.F_0).reshape(B.omega2.shape)


def exponent(x: Any) -> Any:
    """Largest k with 2^k <= x, x > 0: the binary exponent of a float64, which costs less than its logarithm."""
    bits = jax.lax.bitcast_convert_type(jnp.asarray(x, float), jnp.int64)
    return (bits >> 52) - 1023


def spots(D: Array, D_o: Array, rest: Array) -> Spots:
    """Of points with motions D (n, 3, m) and D_o (n, 3, j), that rest at (n, 3)."""
    n, _, m = D.shape
    modes_of = [np.flatnonzero(row.any(axis=0)) for row in D]
    s = max(map(len, modes_of))
    given = D_o.transpose(2, 1, 0), rest.T
    if SPARSE * s > m:
        return Spots(D.transpose(1, 0, 2).reshape(3 * n, m), None, None, *given)
    columns, few = np.zeros((s, n), int), np.zeros((s, 3, n))
    stands = list[list[int]]([] for _ in range(m))
    for i, modes in enumerate(modes_of):
        columns[: len(modes), i], few[: len(modes), :, i] = modes, D[i][:, modes].T
        for row, mode in enumerate(modes):
            stands[mode].append(row * n + i)
    back = np.full((max(map(len, stands)), m), s * n)
    for j, places in enumerate(stands):
        back[: len(places), j] = places
    return Spots(few, columns, back, *given)


def by_modes(S: Spots, q: Any, o: Any) -> Any:
    """(3, n) of the points by modal coordinates (m,) and o (j,), or by their rates."""
    given = (S.D_o * o[:, None, None]).sum(axis=0)
    if S.columns is None:
        return given + times(S.D, q).reshape(given.shape)
    return given + (S.D * q[S.columns][:, None]).sum(axis=0)


def to_modes(S: Spots, force: Any) -> Any:
    """(m,) modal forces by those of the points, (n, 3) N."""
    if S.columns is None:
        return times(S.D.T, force.T.reshape(-1))
    shares = (S.D * force.T).sum(axis=1).reshape(-1)
    return jnp.concatenate([shares, jnp.zeros(1)])[S.back].sum(axis=0)
