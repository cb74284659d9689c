"""The point contact element with a mass: a differential equation with smoothed friction (Sextro, section 3.7).

The point P has a reduced mass and slides on the other body; springs and dampers tie it to the body's point M. Friction
is smoothed by an arctan, so that P creeps where it should stick. As mass and creep vanish this becomes `point`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..compliance import BULK_AND_SURFACE
from ..errors import NotConverged
from .friction import Friction, smoothed
from .law import Array, Law, norm, ratio, settings, static
from .normal import Normal


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
class MassContact(Law):
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
    stiffness_1: Array
    stiffness_2: Array | None
    mass: Array
    damping: Array
    slope: Array
    printed: bool = static(default=False)
    includes: str = static(default=BULK_AND_SURFACE)

    def init(self, n: int) -> MassState:
        none = jnp.zeros((2, n))
        return MassState(none, none, none, jnp.zeros(n), none, jnp.zeros(n))

    def step(self, u: Array, v: Array, dt: Array | float, state: MassState) -> tuple[Array, MassState]:
        """Implicit Euler: of first order, and for a vanishing mass and creep exactly the return map of `point`."""
        approach, tangential = u.T[0], u.T[1:]
        share, pressed, stretch = self._loaded(approach, v.T[0], state)
        springs, time = self._springs(), state.time + dt
        moved = tangential - state.tangential
        trial = self.mass / dt * state.velocity + springs * stretch + springs * (1 + self.damping / dt) * moved
        resistance = self.mass / dt + springs * (dt + self.damping)
        sliding = self._velocity(trial, resistance, ratio(pressed, share), time)
        velocity = jnp.where(share > 0, sliding, moved / dt)
        growth = moved - velocity * dt
        after = stretch + growth
        force = share * springs * (after + self.damping / dt * growth)
        slipped = state.slipped + jnp.where(share > 0, velocity * dt, 0.0)
        settled = MassState(tangential, after, velocity, share, slipped, time)
        return jnp.concatenate([pressed[None], force]).T, settled

    def limit(self, force: Array, state: MassState) -> Array:
        return self.friction.coefficient(jnp.zeros(len(force)), force[:, 0], state.time) * force[:, 0]

    def slip(self, state: MassState) -> Array:
        return state.slipped.T

    def stored(self, u: Array, state: MassState) -> Array:
        """Of the springs, and the motion of P."""
        tangential = jnp.sum(self._springs() * state.stretch**2 + self.mass * state.velocity**2, axis=0)
        return self.normal.stored(u[:, 0]) + 0.5 * state.share * tangential

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
        held = ratio(pressed, share) * self._friction(norm(state.velocity), pressed, state.time)
        drag = held * ratio(state.velocity, norm(state.velocity))
        acceleration = jnp.where(share > 0, (pull - drag) / self.mass, 0.0)
        slipping = jnp.where(share > 0, state.velocity, 0.0)
        return MassState(moving, stretching, acceleration, growth, slipping, jnp.ones_like(state.time))

    def force(self, u: Array, v: Array, state: MassState) -> Array:
        """(n, 3) force in N of a state."""
        share = self.normal.share(u[:, 0])
        pull = self._springs() * (state.stretch + self.damping * (v.T[1:] - state.velocity))
        return jnp.concatenate([self._pressed(u[:, 0], v[:, 0])[None], share * pull]).T

    def _pressed(self, u: Array, v: Array) -> Array:
        return jnp.maximum(self.normal.force(u) + self.damping * self.normal.stiffness(u) * v, 0.0)

    def _springs(self) -> Array:
        """(2, 1) or (2, n) stiffness of the full area, N/m."""
        second = self.stiffness_1 if self.stiffness_2 is None else self.stiffness_2
        return jnp.stack([jnp.atleast_1d(self.stiffness_1), jnp.atleast_1d(second)])

    def _loaded(self, u: Array, v: Array, state: MassState) -> tuple[Array, Array, Array]:
        """Share, normal force, and the stretch of the area that is in contact now."""
        share = self.normal.share(u)
        kept = 1.0 if self.printed else jnp.minimum(ratio(state.share, share, 1.0), 1.0)
        return share, self._pressed(u, v), kept * state.stretch

    def _friction(self, speed: Array, pressed: Array, time: Array) -> Array:
        return self.friction.coefficient(speed, pressed, time) * smoothed(speed, self.slope)

    def _velocity(self, trial: Array, resistance: Array, pressure: Array, time: Array) -> Array:
        """(2, n) velocity of P with resistance v + friction v/|v| = trial: a scalar equation for the speed."""

        def excess(speed: Array) -> Array:
            return norm(self._at(speed, trial, resistance, pressure, time)) - speed

        speed = jax.lax.stop_gradient(_speed(excess, norm(trial) / jnp.min(resistance, axis=0)))
        value, slope = jax.jvp(excess, (speed,), (jnp.ones_like(speed),))
        speed = speed - value / jnp.where(slope < -1e-3, jax.lax.stop_gradient(slope), -1.0)
        return self._at(jnp.maximum(speed, 0.0), trial, resistance, pressure, time)

    def _at(self, speed: Array, trial: Array, resistance: Array, pressure: Array, time: Array) -> Array:
        """(2, n) trial / (resistance + friction / speed)."""
        creep = 2 / jnp.pi * self.slope * self.friction.coefficient(jnp.zeros_like(speed), pressure, time)
        held = ratio(self._friction(speed, pressure, time), speed, 0.0)
        return trial / (resistance + pressure * jnp.where(speed > 0, held, creep))


_HALVINGS = 70  # of a logarithm: creep is ten powers of ten slower than sliding


def _speed(excess: Callable[[Array], Array], fastest: Array) -> Array:
    """(n,) root of a decreasing function between 0 and ``fastest``: halving of the exponent, then of the value."""
    fastest = jax.lax.stop_gradient(fastest)
    safe = jnp.where(fastest > 0, fastest, 1.0)

    def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        above = excess(safe * jnp.exp(middle)) > 0
        return jnp.where(above, middle, low), jnp.where(above, high, middle)

    low, high = jax.lax.fori_loop(0, _HALVINGS, halve, (jnp.full_like(safe, -60.0), jnp.zeros_like(safe)))
    return jnp.where(fastest > 0, safe * jnp.exp(0.5 * (low + high)), 0.0)


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

    Contact opens and closes at times that the motion alone decides: they are found first, and each interval is
    integrated on its own. In an open one P moves with M; what is stretched at lift-off stays so with ``printed``.

    Args:
        motion: jax function of the time (s) with the displacement (3,) in m. times: (s,) rising; the element starts
            at the first one at rest and unstretched. tolerance: relative; absolute to the size of the motion.
        method: of ``scipy.integrate.solve_ivp``.

    Raises:
        NotConverged: the integrator gave up.
    """
    equation = _Equation(law, motion)
    times = np.asarray(times, dtype=float)
    scale = equation.scale(times)
    y, courses = np.zeros(6), []
    for begin, end, closed in equation.intervals(times):
        inside = times[(times >= begin) & (times < end)] if end < times[-1] else times[times >= begin]
        if closed:
            if begin > times[0]:
                y[2:4] = equation.moving(begin)[1][1:]
                y[:2] *= law.printed
            y, part = equation.solve(y, begin, end, inside, tolerance, scale, method)
        else:
            part = np.tile(y, (len(inside), 1))
        courses.append(part)
    told = jax.vmap(equation.told)(jnp.asarray(times), jnp.asarray(np.concatenate(courses)))
    return Course(times, *(np.array(x) for x in told))


class _Equation:
    """The differential equation of one element: y = stretch, velocity and path of P."""

    def __init__(self, law: MassContact, motion: Callable[[Array], Array]) -> None:
        self.law = law
        self.motion = motion
        self.moving = jax.jit(lambda t: jax.jvp(motion, (jnp.asarray(t, float),), (jnp.asarray(1.0),)))
        self.rate = jax.jit(self._rate)
        self.jacobian = jax.jit(jax.jacfwd(self._rate, argnums=1))

    def scale(self, times: np.ndarray) -> np.ndarray:
        """(6,) sizes of the unknowns, for the absolute tolerances."""
        u, v = jax.vmap(self.moving)(jnp.linspace(times[0], times[-1], 1001))
        length = float(jnp.abs(u[:, 1:] - u[0, 1:]).max()) or 1.0
        return np.repeat([length, float(jnp.abs(v[:, 1:]).max()) or 1.0, length], 2)

    def intervals(self, times: np.ndarray) -> list[tuple[float, float, bool]]:
        """Beginning, end, and whether the contact is closed, in order."""
        closed = jax.jit(lambda t: self.law.normal.share(self.motion(t)[:1])[0] > 0)
        grid = np.union1d(times, np.linspace(times[0], times[-1], 8193))
        states = np.array(jax.vmap(closed)(jnp.asarray(grid)))
        ends = [times[0]]
        for i in np.flatnonzero(states[1:] != states[:-1]):
            low, high = grid[i], grid[i + 1]
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if bool(closed(middle)) == states[i] else (low, middle)
            ends.append(high)
        ends.append(times[-1])
        pairs = zip(ends, ends[1:], strict=False)
        return [(a, b, bool(closed(0.5 * (a + b)))) for a, b in pairs if b > a]

    def solve(
        self, y: np.ndarray, begin: float, end: float, inside: np.ndarray, tolerance: float, scale: np.ndarray,
        method: str,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """y at the end of a closed interval, and (s, 6) at the times asked for."""
        from scipy.integrate import solve_ivp

        wanted = np.append(inside, end) if len(inside) == 0 or inside[-1] < end else inside
        options: dict[str, Any] = {"method": method, "rtol": tolerance, "atol": tolerance * scale}
        answer = solve_ivp(self.rate, (begin, end), y, t_eval=wanted, jac=self.jacobian, **options)
        if not answer.success:
            raise NotConverged(f"the point contact element could not be integrated: {answer.message}")
        return answer.y[:, -1], answer.y[:, : len(inside)].T

    def _state(self, t: Array, y: Array) -> tuple[Array, Array, MassState]:
        u, v = jax.jvp(self.motion, (t,), (jnp.ones_like(t),))
        stretch, velocity, path = y[:2, None], y[2:4, None], y[4:, None]
        share = self.law.normal.share(u[:1])
        velocity = jnp.where(share > 0, velocity, v[1:, None])
        return u[None], v[None], MassState(u[1:, None], stretch, velocity, share, path, jnp.atleast_1d(t))

    def _rate(self, t: Array, y: Array) -> Array:
        change = self.law.rate(*self._state(jnp.asarray(t, float), y))
        return jnp.concatenate([change.stretch, change.velocity, change.slipped])[:, 0]

    def told(self, t: Array, y: Array) -> tuple[Array, ...]:
        u, v, state = self._state(t, y)
        force, change = self.law.force(u, v, state), self.law.rate(u, v, state)
        friction = force[0, 1:] - state.share * self.law.mass * change.velocity[:, 0]
        return u[0], force[0], state.slipped[:, 0], state.velocity[:, 0], friction
