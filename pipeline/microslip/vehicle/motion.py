"""A wheelset in its primary suspension on an elastic track: its equations, motion from turn to turn, roots, balance.

Axes move with the frame at a constant speed V: x forward, y to the right, z down. q = (y, z, roll, yaw of the wheelset,
z of the right and of the left rail), u = dq/dt, and Omega, by which the wheelset turns; yaw and roll are small. The
independent variable is the angle of the wheels, so that a turn is a turn whatever their slip. What presses a wheel is
the derivative of an energy, what drags it is conjugate to its slip: with them the balance of energy is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..programs import program
from ..rolling import strips
from ..rolling.kalker import coefficients_at
from ..rolling.table import CreepTable, cubic, placed
from .touch import WheelTouch, at, touched

Array = Any
Q = 6
STATES = 2 * Q + 1


Creep = Callable[..., tuple[Array, Array, Array]]
"""(xi, eta, phi, a, b, normal force, friction, G, nu), arrays (n,) -> F_x, F_y (N), M_z (N m) on the upper body."""


def linear(
    xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, poisson: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Kalker's, without slip: no friction is large enough."""
    c11, c22, c23, c33 = coefficients_at(a / b, poisson) * shear
    c = jnp.sqrt(a * b)
    y = -(c**2) * c22 * eta - c**3 * c23 * phi
    return -(c**2) * c11 * xi, y, c**3 * c23 * eta - c**4 * c33 * phi


def of_strips(**how: Any) -> Creep:
    """`strips.creep_forces`, of these keywords."""

    def forces(*given: Array) -> tuple[Array, Array, Array]:
        pose = strips.poses(*(jnp.broadcast_to(v, given[0].shape) for v in given), **how)
        creep = strips.forces(pose, how.get("elements", (20, 20)), how.get("distribution", "constant"))
        return creep.x, creep.y, creep.moment

    return forces


def of_table(table: CreepTable) -> Creep:
    """What `CreepTable.forces` reads, in a compiled loop; poisson is that of the table, a/b beyond it is its end."""
    axes, values = [jnp.asarray(axis) for axis in table.axes], jnp.asarray(table.values)
    ridge = int(jnp.searchsorted(axes[0], 0.5))
    least, most = float(table.ratio[0]), float(table.ratio[-1])

    def forces(
        xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, _: Array
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        held, c, ratio = friction * force, jnp.sqrt(a * b), jnp.clip(a / b, least, most)
        p = strips.poses(xi, eta, phi, a, b, held, jnp.ones_like(a), shear, table.poisson, **table.how)
        at, signs = placed(p, ratio, jnp)
        weights = [
            cubic(axis, v, ridge if k == 0 else 0, jnp) for k, (axis, v) in enumerate(zip(axes, at, strict=True))
        ]
        x, y, moment = jnp.stack([_between(values, weights, i) for i in range(len(xi))], axis=1) * signs * held
        return x, y, c * moment

    return forces


def _between(values: Array, weights: list[tuple[Array, Array]], i: int) -> Array:
    """(3,) values at the place i."""
    first = [jnp.int32(0), *(first[i].astype(jnp.int32) for first, _ in weights)]
    near = jax.lax.dynamic_slice(values, first, [len(values), *(w.shape[1] for _, w in weights)])
    for _, weight in reversed(weights):
        near = near @ weight[i]
    return near


class Vehicle(NamedTuple):
    """Numbers of the equations; SI.

    Attributes:
        mass, damping, stiffness: (6, 6) of q. spin_inertia: of the wheelset about its axle, kg m2. load: on the
            wheelset without what the suspension takes as it sinks, its weight included, N. torque: that drives it, N m.
            speed: V. over, reach: see `touch.Touching`. each: load of each wheel as it stands, by which the half axes
            of `over` are, N. friction, shear, poisson: of the contact.
    """

    mass: Array
    damping: Array
    stiffness: Array
    spin_inertia: float
    load: float
    torque: float
    speed: float
    over: WheelTouch
    reach: float
    each: float
    friction: float
    shear: float
    poisson: float


class WheelContacts(NamedTuple):
    """Of both wheels, (..., 2), right first: states of rolling as `rolling.strips.creep_forces` takes them, and where.

    Attributes:
        on_wheel: y of the wheel's profile, m. speed: of rolling, m/s. vertical: of the normal force, N.
    """

    xi: Array
    eta: Array
    phi: Array
    a: Array
    b: Array
    normal_force: Array
    on_wheel: Array
    speed: Array
    vertical: Array


LEAST = 1e-6
"""Of the static load: below this a wheel counts as off its rail."""


def _pressed(v: Vehicle, q: Array, out: Array) -> tuple[Array, WheelTouch]:
    """(2,) vertical approach of wheels that are out of round by (2,) m, and where they touch."""
    t = at(v.over, v.reach, q[0])
    down = q[1] - t.height + t.arm * (q[2] - t.roll) - q[4:6] + 0.5 * q[3] ** 2 * t.slope * t.arm
    return down + out, t


def _contact_energy(q: Array, v: Vehicle, out: Array) -> Array:
    p, t = _pressed(v, q, out)
    return jnp.sum(t.spring * jnp.maximum(p, 0.0) ** 2.5) / 2.5


def _slip(moved: Array, v: Vehicle, q: Array, out: Array, t: WheelTouch) -> tuple[Array, Array, Array]:
    """(2,) velocities of the wheels on their rails, forward and to the left, m/s, and turn about their normals."""
    u, turning = moved[:Q], moved[Q]
    c = 1 / jnp.sqrt(1 + t.slope**2)
    rim = turning * (t.radius + out)
    across = u[0] - t.radius * u[2] - rim * q[3]
    down = u[1] + t.across * u[2] - u[4:6] - rim * q[3] * t.slope  # it touches ahead of the axle
    spin = -turning * (t.slope * c - c * q[2]) - u[3] * c
    return v.speed - rim - u[3] * t.across, -(c * across + t.slope * c * down), spin


def contacts(v: Vehicle, x: Array, out: Array) -> WheelContacts:
    """At one state (13,) of wheels that are out of round by (2,) m."""
    q, moved = x[:Q], x[Q:]
    p, t = _pressed(v, q, out)
    vertical = t.spring * jnp.maximum(p, 0.0) ** 1.5
    normal = jnp.maximum(vertical, LEAST * v.each) * jnp.sqrt(1 + t.slope**2)
    grown = (normal / v.each) ** (1 / 3)
    mean = 0.5 * (v.speed + moved[Q] * (t.radius + out))
    xi, eta, phi = (s / mean for s in _slip(moved, v, q, out, t))
    return WheelContacts(xi, eta, phi, t.a * grown, t.b * grown, normal, t.on_wheel, mean, vertical)


def rates(v: Vehicle, creep: Creep, x: Array, out: Array, rise: Array) -> tuple[Array, Array]:
    """dx/dt (13,), and the powers (4,) of the pull of the frame, the torque, friction and dampers, W.

    Args:
        out, rise: (2,) of the wheels' radii, m, and their derivative over the angle, m.
    """
    q, moved = x[:Q], x[Q:]
    u, turning = moved[:Q], moved[Q]
    on = contacts(v, x, out)
    touching = on.vertical > LEAST * v.each
    x_, y_, moment = creep(*on[:6], v.friction, v.shear, v.poisson)
    found = (jnp.where(touching, x_, 0.0), jnp.where(touching, y_, 0.0), jnp.where(touching, moment, 0.0))
    t = at(v.over, v.reach, q[0])
    slip, back = jax.vjp(lambda m: _slip(m, v, q, out, t), moved)
    (dragged,) = back(found)
    pressed = -jax.grad(_contact_energy)(q, v, out)
    gyro = v.spin_inertia * turning * jnp.stack([0.0, 0.0, -u[3], u[2], 0.0, 0.0])
    force = pressed + dragged[:Q] + gyro - v.stiffness @ q - v.damping @ u
    force = force.at[1].add(v.load)
    spun = (v.torque + dragged[Q] - jnp.sum(on.vertical * rise)) / v.spin_inertia
    friction = -sum(jnp.sum(f * s) for f, s in zip(found, slip, strict=True))
    powers = jnp.stack([-jnp.sum(found[0]) * v.speed, v.torque * turning, friction, u @ v.damping @ u])
    return jnp.concatenate([u, jnp.linalg.solve(v.mass, force), spun[None]]), powers


def energy(v: Vehicle, x: Array, out: Array) -> Array:
    """Of motion besides V, of springs, contacts and height, J."""
    q, u = x[:Q], x[Q : 2 * Q]
    motion = 0.5 * (u @ v.mass @ u + v.spin_inertia * x[2 * Q] ** 2)
    return motion + 0.5 * q @ v.stiffness @ q - v.load * q[1] + _contact_energy(q, v, out)


class WheelTurn(NamedTuple):
    """A turn of the wheels. Attributes: end: (13,). states: (n, 13) at n equal angles. on: `WheelContacts` there,
    (n, 2). work: (4,) of `rates`, J. time: s."""

    end: Array
    states: Array
    on: WheelContacts
    work: Array
    time: Array


@partial(program, static_argnames=("creep", "every"))
def turned(v: Vehicle, creep: Creep, start: Array, out: Array, rise: Array, every: int) -> WheelTurn:
    """One turn by the method of Runge and Kutta of fourth order.

    Args:
        out, rise: (2 n, 2) of both wheels' radii at half steps, m, and their derivatives over the angle. every: steps
            from one place that is kept to the next.
    """
    steps = out.shape[0] // 2
    h = 2 * jnp.pi / steps

    def rate(y: Array, o: Array, r: Array) -> Array:
        dx, powers = rates(v, creep, y[:STATES], o, r)
        return jnp.concatenate([dx, powers, jnp.ones(1)]) / y[2 * Q]

    def step(y: Array, shape: tuple[Array, Array]) -> tuple[Array, Array]:
        (o0, o1, o2), (r0, r1, r2) = shape
        k1 = rate(y, o0, r0)
        k2 = rate(y + 0.5 * h * k1, o1, r1)
        k3 = rate(y + 0.5 * h * k2, o1, r1)
        k4 = rate(y + h * k3, o2, r2)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), y[:STATES]

    def three(f: Array) -> Array:
        return jnp.stack([f[0::2], f[1::2], jnp.roll(f[0::2], -1, axis=0)], axis=1)

    end, passed = jax.lax.scan(step, jnp.concatenate([start, jnp.zeros(5)]), (three(out), three(rise)))
    states = passed[::every]
    on = jax.vmap(lambda x, o: contacts(v, x, o))(states, out[:: 2 * every])
    return WheelTurn(end[:STATES], states, on, end[STATES:-1], end[-1])


@partial(program, static_argnames=("creep",))
def _linearised(v: Vehicle, creep: Creep, x: Array) -> tuple[Array, Array]:
    none = jnp.zeros(2)
    return rates(v, creep, x, none, none)[0], jax.jacfwd(lambda x: rates(v, creep, x, none, none)[0])(x)


def sunk(t: WheelTouch, each: float, stiffness: Array) -> tuple[float, float]:
    """How deep, m, wheelset and rails stand under the load of each wheel, where `t` is that of no shift."""
    rail = each / float(stiffness[4, 4])
    return float(t.height[0]) + (each / float(t.spring[0])) ** (2 / 3) + rail, rail


def steady(v: Vehicle) -> Array:
    """(13,) of round wheels that run straight, by Kalker's linear theory."""
    t = touched(v.over, v.reach, 0.0)
    x = np.zeros(STATES)
    x[1], rail = sunk(t, v.each, v.stiffness)
    x[4:6], x[2 * Q] = rail, v.speed / float(t.radius[0])
    for _ in range(30):
        f, J = map(np.asarray, _linearised(v, linear, x))
        change = np.linalg.solve(J, -f)
        x = x + change
        if np.abs(change[:Q]).max() < 1e-13:
            break
    return x


def roots(v: Vehicle) -> tuple[Array, Array]:
    """(13,) complex roots of the linear motion about steady running, 1/s, and (13, 13) their shapes."""
    return np.linalg.eig(np.asarray(_linearised(v, linear, steady(v))[1]))


def hunting(v: Vehicle) -> complex:
    """The root that grows fastest of those whose motion is mostly lateral and yaw, 1/s."""
    values, shapes = roots(v)
    velocities = shapes[Q : 2 * Q]
    of_each = np.abs(velocities) ** 2 * np.diag(v.mass)[:, None]
    lateral = of_each[[0, 3]].sum(axis=0) > 0.5 * of_each.sum(axis=0)
    chosen = values[lateral & (values.imag >= 0)]
    return complex(chosen[chosen.real.argmax()])


def critical_speed(v: Vehicle, low: float, high: float) -> float | None:
    """m/s from which on the steady running is unstable; None if it is not between low and high."""
    from scipy.optimize import brentq

    def growth(speed: float) -> float:
        return hunting(v._replace(speed=speed)).real

    speeds = np.geomspace(low, high, 13)
    grown = [growth(s) for s in speeds]
    if grown[0] > 0:
        return None
    i = next((i for i, g in enumerate(grown) if g > 0), None)
    return None if i is None else float(brentq(growth, speeds[i - 1], speeds[i], xtol=1e-6))


ACCURATE = 0.5
"""Fastest root times a step: the method is stable to 2.8, its error over a turn is then 1e-4 and less."""


def steps_of_a_turn(v: Vehicle, places: int) -> int:
    """A multiple of the places, so that the fastest root is resolved."""
    fastest = np.abs(roots(v)[0]).max()
    period = 2 * np.pi / steady(v)[2 * Q]
    return places * int(np.ceil(fastest * period / ACCURATE / places))


def resampled(shape: Array, points: int) -> tuple[Array, Array]:
    """(points, 2) of (places, 2) values over a turn, and their derivative over the angle, by their harmonics."""
    places = len(shape)
    harmonics = np.fft.rfft(shape, axis=0) * (points / places)
    if places % 2 == 0:
        harmonics[-1] = 0.0
    whole = np.zeros((points // 2 + 1, shape.shape[1]), complex)
    whole[: len(harmonics)] = harmonics
    order = 1j * np.arange(len(whole))[:, None]
    return np.fft.irfft(whole, points, axis=0), np.fft.irfft(order * whole, points, axis=0)
