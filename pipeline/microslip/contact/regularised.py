"""The point contact element with a mass: a differential equation with smoothed friction (Sextro, section 3.7).

The point P has a reduced mass and slides on the other body; springs and dampers tie it to the body's point M. Friction
is smoothed by an arctan, so that P creeps where it should stick. As mass and creep vanish this becomes `point`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from ..errors import NotConverged
from ..reduced.compliance import BULK_AND_SURFACE
from ..settings.numbers import NotNegative, Positive
from .friction import Friction, creep, halved
from .law import Array, Law, Step, norm, number, ratio, settings, static, value
from .normal import Normal
from .point import OnNormal, OwnNormal, met, touching
from .solids import bisected

if TYPE_CHECKING:
    from .composed import ContactModel


class MassState(NamedTuple):
    """State of n points: u_t of M (2, n) m, stretch of the springs (2, n) m, velocity of P (2, n) m/s, share (n,),
    path of P (2, n) m, time (n,) s."""

    tangential: Array
    stretch: Array
    velocity: Array
    share: Array
    slipped: Array
    time: Array


@settings
class MassContact(OnNormal):
    """Point contact with a reduced mass (Sextro Eqs. (3.7-19) to (3.7-30), with the errata).

    Mass, springs and dampers are all in proportion to the area in contact, h* (3.7-8, 3.7-16, 3.7-18), which cancels:
    m v' = k e + beta k e' - mu(|v|) s(|v|) F_N / h* v/|v|, where e is the stretch of the springs, M less P. Where the
    contact is open, P moves with M (3.7-27). Where a damper would pull on an area still in contact, the normal force
    is zero (3.7-30) and P moves freely under spring and damper.

    ``printed`` keeps the stretch as M less P whatever the area does, as the book has it: stuck and moved under a
    changing load it can then give energy. Otherwise area that comes into contact is not stretched yet, as in `point`.

    Attributes:
        normal: normal law. friction: characteristic. stiffness_1: along t1 of the full area, N/m; stiffness_2: along
            t2, the same if None. mass: m_D of the full area (3.7-7), kg. damping: beta, s. slope: k_S of the smoothing
            (3.7-43), s/m. printed: the book's stretch. includes: whose compliance the stiffnesses count, one of
            `series.INCLUDES`.
    """

    normal: Normal
    friction: Friction
    stiffness_1: Array = number(ge=0)
    stiffness_2: Array | None = number(ge=0)
    mass: Array = number(gt=0)
    damping: Array = number(ge=0)
    slope: Array = number(gt=0)
    printed: bool = static(default=False)
    includes: str = static(default=BULK_AND_SURFACE)

    def init(self, n: int) -> MassState:
        none = jnp.zeros((2, n))
        return MassState(none, none, none, jnp.ones(n), none, jnp.zeros(n))

    def step(self, u: Array, v: Array, dt: Array | float, state: MassState) -> tuple[Array, MassState]:
        """Implicit Euler: of first order, and for a vanishing mass and creep exactly the return map of `point`."""
        approach, tangential = u.T[0], u.T[1:]
        share, pressed, stretch, carries = self._loaded(approach, v.T[0], state)
        springs, time = self._springs(), state.time + dt
        moved = tangential - state.tangential
        trial = self.mass / dt * state.velocity + springs * stretch + springs * (carries + self.damping / dt) * moved
        resistance = self.mass / dt + springs * (carries * dt + self.damping)
        sliding = self._velocity(trial, resistance, pressed, share, time)
        velocity = jnp.where(share > 0, sliding, moved / dt)
        growth = moved - velocity * dt
        after = stretch + carries * growth
        force = share * springs * (after + self.damping / dt * growth)
        slipped = state.slipped + jnp.where(share > 0, velocity * dt, 0.0)
        settled = MassState(tangential, after, velocity, share, slipped, time)
        return jnp.concatenate([pressed[None], force]).T, settled

    def stored(self, u: Array, state: MassState) -> Array:
        """Of the springs, and the motion of P."""
        tangential = jnp.sum(self._springs() * state.stretch**2 + self.mass * state.velocity**2, axis=0)
        return self.normal.stored(u[:, 0]) + 0.5 * state.share * tangential

    def lost(self, step: Step) -> Array:
        """The steps' own loss of the motion of P, which is of first order, is none of it."""
        before, after = step.before, step.after
        speed, closed = norm(after.velocity), after.share > 0
        drag = self._drag(speed, 0.5 * (step.force_before + step.force)[:, 0], after.share, after.time)
        rubbed = jnp.where(closed, after.share * drag * speed**2 * step.dt, 0.0)
        growth = step.moved.T[1:] - after.velocity * step.dt
        across = after.share * jnp.sum(self._springs() * self.damping / step.dt * growth**2, axis=0)
        normal = (step.force[:, 0] - self.normal.force(step.u[:, 0])) * step.moved[:, 0]
        moving = [jnp.sum(self._springs() * s.stretch**2 + self.mass * s.velocity**2, axis=0) for s in (before, after)]
        change = before.share - after.share
        area = 0.25 * (change if self.printed else jnp.abs(change)) * (moving[0] + moving[1])
        return rubbed + across + normal + area

    def rate(self, u: Array, v: Array, state: MassState) -> MassState:
        """Time derivative of the state, for integrators: the differential equation itself.

        Args:
            u: (n, 3) m. v: (n, 3) m/s, both at the time of the state.
        """
        share, growth = jax.jvp(self.normal.share, (u[:, 0],), (v[:, 0],))
        pressed, moving = self._pressed(u[:, 0], v[:, 0]), v.T[1:]
        renewed = 0.0 if self.printed else ratio(jnp.maximum(growth, 0.0), share)
        stretching = moving - state.velocity - renewed * state.stretch
        pull = self._springs() * (state.stretch + self.damping * (moving - state.velocity))
        drag = self._drag(norm(state.velocity), pressed, share, state.time) * state.velocity
        acceleration = jnp.where(share > 0, (pull - drag) / self.mass, 0.0)
        slipping = jnp.where(share > 0, state.velocity, 0.0)
        return MassState(moving, stretching, acceleration, growth, slipping, jnp.ones_like(state.time))

    def force(self, u: Array, v: Array, state: MassState) -> Array:
        """(n, 3) force in N of a state."""
        share = self.normal.share(u[:, 0])
        pull = self._springs() * (state.stretch + self.damping * (v.T[1:] - state.velocity))
        return jnp.concatenate([self._pressed(u[:, 0], v[:, 0])[None], share * pull]).T

    @property
    def remembers(self) -> int | None:
        return 4

    def rates(self, u: Array, v: Array, x: Array, time: Array | float, lag: float) -> tuple[Array, Array]:
        """x: stretch of the springs, m, and velocity of P, m/s; open, P follows M on springs and dampers."""
        share = self.normal.share(u[:, 0])
        state = MassState(u.T[1:], x[:2], x[2:], share, 0 * x[:2], jnp.broadcast_to(time, share.shape))
        rate = self.rate(u, v, state)
        pulled = self._springs() * (x[:2] + self.damping * (v.T[1:] - x[2:])) / self.mass
        moving = jnp.where(share > 0, rate.velocity, pulled)
        return self.force(u, v, state), jnp.concatenate([rate.stretch, moving])

    def _springs(self) -> Array:
        """(2, 1) or (2, n) stiffness of the full area, N/m."""
        second = self.stiffness_1 if self.stiffness_2 is None else self.stiffness_2
        return jnp.stack([jnp.atleast_1d(self.stiffness_1), jnp.atleast_1d(second)])

    def _loaded(self, u: Array, v: Array, state: MassState) -> tuple[Array, Array, Array, Array]:
        """Share, normal force, the stretch of the area that is in contact now, and the share of it that carries over
        the step (`point.met`)."""
        share = self.normal.share(u)
        if self.printed:
            return share, self._pressed(u, v), state.stretch, jnp.ones_like(share)
        kept = jnp.minimum(ratio(state.share, share, 1.0), 1.0)
        before = jnp.maximum(state.share, touching(self.normal, u))
        return share, self._pressed(u, v), kept * state.stretch, ratio(met(share, before), share, 1.0)

    def _drag(self, speed: Array, pressed: Array, share: Array, time: Array) -> Array:
        """(n,) friction over the speed and the share, Ns/m."""
        return ratio(pressed, share) * self.friction.coefficient(speed, pressed, time) * creep(speed, self.slope)

    def _velocity(self, trial: Array, resistance: Array, pressed: Array, share: Array, time: Array) -> Array:
        """(2, n) velocity of P with (resistance + drag(|v|)) v = trial: a scalar equation for the speed."""

        def at(speed: Array) -> Array:
            return trial / (resistance + self._drag(speed, pressed, share, time))

        def excess(speed: Array) -> Array:
            return speed - norm(at(speed))

        fastest = jax.lax.stop_gradient(norm(trial) / jnp.min(resistance, axis=0))
        speed = jax.lax.stop_gradient(halved(excess, fastest, 60.0, 70))  # creep is ten powers of ten below sliding
        value, slope = jax.jvp(excess, (speed,), (jnp.ones_like(speed),))
        speed = speed - value / jnp.where(slope > 1e-3, jax.lax.stop_gradient(slope), 1.0)
        return at(jnp.maximum(speed, 0.0))


@dataclass(frozen=True)
class Course:
    """What one integrated element did at the times asked for.

    Attributes:
        time: (s,) s. motion: (s, 3) of M, m. force: (s, 3) N on M. point: (s, 2) path of P while in contact, m.
        velocity: (s, 2) of P, m/s. friction: (s, 2) N on P: the springs' force less that of inertia.
    """

    time: np.ndarray
    motion: np.ndarray
    force: np.ndarray
    point: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray


def integrate(
    law: MassContact, motion: Callable[[Array], Array], times: np.ndarray, tolerance: float = 1e-8,
    method: str = "Radau",
) -> Course:  # fmt: skip
    """One element under a prescribed motion, by an integrator for stiff equations with the exact Jacobian.

    ContactModel opens and closes at times that the motion alone decides: they are found first, and each interval is
    integrated on its own. In an open one P moves with M; what is stretched at lift-off stays so with ``printed``.
    What is compiled is kept for other numbers of the law and the same ``motion``.

    Args:
        motion: jax function of the time (s) with the displacement (3,) in m. times: (s,) rising; the element starts
            at the first one at rest and unstretched. tolerance: relative; absolute to the size of the motion.
        method: of ``scipy.integrate.solve_ivp``: Radau or BDF; LSODA is apt to give up where stick turns to slip.

    Raises:
        NotConverged: the integrator gave up.
    """
    times = np.asarray(times, dtype=float)
    absolute = tolerance * _scale(motion, times)
    absolute[2:4] = np.minimum(absolute[2:4], 0.1 / float(np.max(law.slope)))  # or stick and slip are one to it
    y, courses = np.zeros(6), []
    for begin, end, closed in _intervals(law, motion, times):
        inside = times[(times >= begin) & (times < end)] if end < times[-1] else times[times >= begin]
        if closed:
            if begin > times[0]:
                y[2:4] = _moving(motion, begin)[1][1:]
                y[:2] *= law.printed
            y, part = _solve(law, motion, y, (begin, end), inside, tolerance, absolute, method)
        else:
            part = np.tile(y, (len(inside), 1))
        courses.append(part)
    return Course(times, *map(np.array, _told(law, motion, times, np.concatenate(courses))))


# The unknowns of one element are y = stretch, velocity and path of P. A motion is a part of the program.


def _scale(motion: Callable[[Array], Array], times: np.ndarray) -> np.ndarray:
    """(6,) sizes of the unknowns, for the absolute tolerances."""
    u, v = _path(motion, np.linspace(times[0], times[-1], 1001))
    length = float(np.abs(u[:, 1:] - u[0, 1:]).max()) or 1.0
    return np.repeat([length, float(np.abs(v[:, 1:]).max()) or 1.0, length], 2)


def _intervals(
    law: MassContact, motion: Callable[[Array], Array], times: np.ndarray
) -> list[tuple[float, float, bool]]:
    """Beginning, end, and whether the contact is closed, in order."""
    grid = np.linspace(times[0], times[-1], 8193)
    states = np.asarray(_closed(law, motion, grid))

    def change(i: int) -> np.ndarray:
        """s, at which what holds at a sample ends."""
        _, high = bisected(
            lambda t: _closed(law, motion, np.array([t]))[0] == states[i], grid[i], grid[i + 1], 60
        )
        return high

    ends = [grid[0], *map(change, np.flatnonzero(states[1:] != states[:-1]).tolist()), grid[-1]]
    pairs = [(float(a), float(b)) for a, b in zip(ends, ends[1:], strict=False) if b > a]
    return [(a, b, bool(_closed(law, motion, np.array([0.5 * (a + b)]))[0])) for a, b in pairs]


_MOST = 5_000_000  # evaluations of a closed interval, some minutes; the figures of the book take thousands


def _solve(
    law: MassContact, motion: Callable[[Array], Array], y: np.ndarray, span: tuple[float, float], inside: np.ndarray,
    tolerance: float, absolute: np.ndarray, method: str,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """y at the end of a closed interval, and (s, 6) at the times asked for."""
    wanted = np.append(inside, span[1]) if len(inside) == 0 or inside[-1] < span[1] else inside
    options: dict[str, Any] = {"method": method, "rtol": tolerance, "atol": absolute, "t_eval": wanted}
    options["jac"] = lambda t, y: np.asarray(_jacobian(law, motion, t, y))
    spent = itertools.count()

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        if next(spent) > _MOST:
            raise NotConverged(
                f"the point contact element changes too fast to be integrated, first at {t:.6g} s: give it a larger "
                "mass or damping, a smaller slope, or friction that scatters less fast"
            )
        return np.asarray(_rate(law, motion, t, y))

    answer = solve_ivp(rate, span, y, **options)
    if not answer.success:
        raise NotConverged(f"the point contact element could not be integrated: {answer.message}")
    return answer.y[:, -1], answer.y[:, : len(inside)].T


@partial(jax.jit, static_argnums=0)
def _moving(motion: Callable[[Array], Array], t: Array | float) -> tuple[Array, Array]:
    """Displacement and velocity of M (3,)."""
    t = jnp.asarray(t, float)
    return jax.jvp(motion, (t,), (jnp.ones_like(t),))


@partial(jax.jit, static_argnums=0)
def _path(motion: Callable[[Array], Array], t: Array) -> tuple[Array, Array]:
    return jax.vmap(lambda one: _moving(motion, one))(t)


@partial(jax.jit, static_argnums=1)
def _closed(law: MassContact, motion: Callable[[Array], Array], t: Array) -> Array:
    return law.normal.share(jax.vmap(motion)(t)[:, 0]) > 0


def _state(law: MassContact, motion: Callable[[Array], Array], t: Array, y: Array) -> tuple[Array, Array, MassState]:
    u, v = _moving(motion, t)
    stretch, velocity, path = y[:2, None], y[2:4, None], y[4:, None]
    share = law.normal.share(u[:1])
    velocity = jnp.where(share > 0, velocity, v[1:, None])
    return u[None], v[None], MassState(u[1:, None], stretch, velocity, share, path, jnp.atleast_1d(t))


@partial(jax.jit, static_argnums=1)
def _rate(law: MassContact, motion: Callable[[Array], Array], t: Array, y: Array) -> Array:
    change = law.rate(*_state(law, motion, t, y))
    return jnp.concatenate([change.stretch, change.velocity, change.slipped])[:, 0]


_jacobian = jax.jit(jax.jacfwd(_rate, argnums=3), static_argnums=1)


@partial(jax.jit, static_argnums=1)
def _told(law: MassContact, motion: Callable[[Array], Array], times: Array, ys: Array) -> tuple[Array, ...]:
    """What `Course` holds, at many times."""

    def one(t: Array, y: Array) -> tuple[Array, ...]:
        u, v, state = _state(law, motion, t, y)
        force, change = law.force(u, v, state), law.rate(u, v, state)
        friction = force[0, 1:] - state.share * law.mass * change.velocity[:, 0]
        return u[0], force[0], state.slipped[:, 0], state.velocity[:, 0], friction

    return jax.vmap(one)(times, ys)


# the element of a contact file ---------------------------------------------------------------------------------------


class WithMass(OwnNormal):
    """The point contact element with a mass and smoothed friction (3.7-19 to 3.7-44): a differential equation."""

    kind: Literal["with-mass"]
    mass: Positive
    """[kg] m_D, reduced mass of the full area"""
    slope: Positive
    """[s/m] k_S of the smoothed friction (3.7-43)"""
    damping: NotNegative = 0.0
    """[s] beta: force per rate of the springs (3.7-18)"""
    printed: bool = False
    """the book's stretch of the springs, which may give energy"""

    def law(self, contact: ContactModel) -> Law:
        mass, damping, slope = map(value, (self.mass, self.damping, self.slope))
        return MassContact(contact.normal, contact.sliding, *contact.springs, mass, damping, slope, self.printed)
