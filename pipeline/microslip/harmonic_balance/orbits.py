"""Complex tangential stiffnesses of a point on an elliptic orbit (Sextro Eqs. (5.2-15) to (5.2-30)), as a table.

Everything is dimensionless: the spring has stiffness 1 and friction holds the force 1, so that the half-axes are
eta_A* = c_R eta_A / (mu F_N). The slider has no mass: its force F is that of the spring, never longer than 1, and while
it slides it points along the slip.

The orbit is eta = A cos(tau), zeta = B sin(tau), A >= B >= 0. Below A = 1 the slider sticks and both stiffnesses are 1.
Beyond, there are orbits on which it sticks twice a cycle, and orbits on which it never does: those beyond a half-axis
A_c(B / A). The stiffnesses bend sharply where the two meet, so each has a table of its own, whose coordinates are the
share e = B / A and the way from A = 1 to A_c, or from A_c to infinity.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import settings
from ..data import Array
from ..programs import inner
from .tables import Spline, Table, fitted, in_chunks, kept, read, refined

THINNEST, LONGEST = 1e-5, 1e6
"""Share e of the half-axes, and half-axis A, beyond which the orbit is taken as a line, and the force as all slip."""

ROUND = 1e-4
"""1 - e below which an orbit is next to a circle."""

TOLERANCE = 1e-3
"""Of the force over what friction holds, at the worst place of the table; at 99 of 100 places it is ten times less."""


Four = tuple[jax.Array, jax.Array, jax.Array, jax.Array]

# The motion of the slider ------------------------------------------------------------------------------------------


def segment(F: jax.Array, d: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Force after a straight way, and its mean over the way: exact, whatever the length.

    The spring takes up the way until the force is 1. From there the angle beta between force and way obeys
    d beta / ds = - sin(beta), so that tan(beta / 2) falls as exp(-s).

    Args:
        F: (2, n) before, not longer than 1. d: (2, n) way.
    """
    way = jnp.sqrt(jnp.sum(d**2, axis=0))
    divisor = jnp.where(way > 0, way, 1.0)
    e, trial = d / divisor, F + d
    slips = jnp.sum(trial**2, axis=0) > 1
    along, room = jnp.sum(F * d, axis=0), jnp.maximum(1 - jnp.sum(F**2, axis=0), 0.0)
    root = jnp.sqrt(along**2 + way**2 * room)
    outward = room / jnp.where(along + root > 0, along + root, 1.0)
    share = jnp.where(slips, jnp.clip(jnp.where(along > 0, outward, (root - along) / divisor**2), 0.0, 1.0), 1.0)
    on_cone = F + share * d
    cosine = jnp.clip(jnp.sum(on_cone * e, axis=0), 0.0, 1.0)
    first = (e[0] * on_cone[1] - e[1] * on_cone[0]) / (1 + cosine)  # tan(beta / 2)
    left = (1 - share) * way
    last = first * jnp.exp(-left)
    parts = jnp.stack([1 - last**2, 2 * last]) / (1 + last**2)
    summed = jnp.stack(
        [left + jnp.log((1 + last**2) / (1 + first**2)), 2 * jnp.arctan((last - first) / (1 + first * last))]
    )
    summed = summed.at[1].multiply(-1.0)
    slid, mean = _turned(parts, e), 0.5 * share * (F + on_cone) + _turned(summed, e) / divisor
    return jnp.where(slips, slid, trial), jnp.where(slips, mean, 0.5 * (F + trial))


def _turned(parts: jax.Array, e: jax.Array) -> jax.Array:
    """Vectors of parts along and across a direction e."""
    return jnp.stack([e[0] * parts[0] - e[1] * parts[1], e[1] * parts[0] + e[0] * parts[1]])


@partial(inner, static_argnames="samples")
def half_cycle(F: jax.Array, A: jax.Array, B: jax.Array, samples: int) -> tuple[jax.Array, jax.Array]:
    """Force after half a cycle from the apex (A, 0), and (4, n) first harmonics over it by straight ways.

    The ways are short at the apex, the shorter the thinner the ellipse. The harmonics are those of 5.2-25 to 5.2-28
    times the half-axes, A c_eta, A b_eta, B c_zeta, B b_zeta, if the other half of the cycle is the opposite of this
    one.
    """
    thin = jnp.clip(B / A, 0.05, 1.0)

    def one(carried: Four, k: jax.Array) -> tuple[Four, None]:
        F, summed, c, s = carried
        t = k * (np.pi / samples)
        tau = t - 0.5 * (1 - thin) * jnp.sin(2 * t)
        c1, s1 = jnp.cos(tau), jnp.sin(tau)
        dc, ds = c1 - c, s1 - s
        F, mean = segment(F, jnp.stack([A * dc, B * ds]))
        return (F, summed + jnp.stack([mean[0] * ds, mean[0] * dc, -mean[1] * dc, mean[1] * ds]), c1, s1), None

    zero = jnp.zeros_like(A)
    start = F, jnp.zeros((4, *A.shape)), zero + 1, zero
    (F, summed, _, _), _ = jax.lax.scan(one, start, jnp.arange(1.0, samples + 1))
    return F, summed * (2 / np.pi)


@partial(inner, static_argnames="samples")
def sliding_half(
    psi: jax.Array, A: jax.Array, B: jax.Array, samples: int
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Half a cycle without sticking, by Runge and Kutta's method of fourth order.

    Returns:
        Angle of the force after it, logarithm of its derivative with respect to psi, (4, n) harmonics as
        `half_cycle`'s, least speed of the slip; n orbits each.
    """
    h = np.pi / samples

    def across(p: jax.Array, t: jax.Array) -> jax.Array:
        return A * jnp.sin(t) * jnp.sin(p) + B * jnp.cos(t) * jnp.cos(p)

    def one(carried: Four, k: jax.Array) -> tuple[Four, None]:
        p, growth, summed, least = carried
        t = k * h
        k1 = across(p, t)
        k2 = across(p + 0.5 * h * k1, t + 0.5 * h)
        k3 = across(p + 0.5 * h * k2, t + 0.5 * h)
        k4 = across(p + h * k3, t + h)
        c, s, x, y = jnp.cos(t), jnp.sin(t), jnp.cos(p), jnp.sin(p)
        speed = -A * s * x + B * c * y
        summed = summed + jnp.stack([x * c, -x * s, y * s, y * c])
        return (p + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), growth - h * speed, summed, jnp.minimum(least, speed)), None

    zero = jnp.zeros_like(A)
    (p, growth, summed, least), _ = jax.lax.scan(
        one, (psi, zero, jnp.zeros((4, *A.shape)), zero + jnp.inf), jnp.arange(0.0, samples)
    )
    return p, growth, summed * (2 / samples), least


def sliding(A: Array, B: Array, samples: int = 512, steps: int = 14) -> tuple[Array, Array, Array]:
    """Steady orbits without sticking: (4, n) harmonics, least speed of the slip, what Newton's method left of psi."""

    def some(A: jax.Array, B: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        most = jnp.maximum(jnp.arccos(jnp.minimum(1 / A, 1.0)), 1e-9)
        psi = most
        for _ in range(steps):
            p, growth, *_ = sliding_half(psi, A, B, samples)
            wrong = (p - psi - np.pi) / jnp.minimum(jnp.expm1(growth), -1e-12)
            psi = psi - jnp.clip(wrong, -0.7 * most, 0.7 * most)
        p, _, summed, least = sliding_half(psi, A, B, samples)
        return summed, least, jnp.abs(p - psi - np.pi)

    found = in_chunks(some, A, B)
    return found[0], found[1], found[2]


def sticking(A: Array, B: Array, samples: int = 512) -> Array:
    """(4, n) harmonics of steady orbits by the return map; extrapolated from two numbers of ways."""

    def some(F: jax.Array, A: jax.Array, B: jax.Array) -> tuple[jax.Array]:
        F = -half_cycle(F, A, B, samples)[0]
        coarse, fine = half_cycle(F, A, B, samples)[1], half_cycle(F, A, B, 2 * samples)[1]
        return ((4 * fine - coarse) / 3,)

    return in_chunks(some, _settled(A, B), A, B)[0]


def _settled(A: Array, B: Array) -> Array:
    """(2, n) force at the apex of steady orbits; those that change are marched on, to 480 half cycles at most."""
    F = np.stack([np.ones_like(A), np.zeros_like(A)])
    open_ = np.arange(len(A))

    def some(f: jax.Array, a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
        for _ in range(16):
            before, f = f, -half_cycle(f, a, b, 128)[0]
        return f, jnp.abs(f - before).max(axis=0)

    for _ in range(30):
        F[:, open_], change = in_chunks(some, F[:, open_], A[open_], B[open_])
        open_ = open_[change > 1e-6]
        if not len(open_):
            break
    return F


def _never_sticking(A: Array, B: Array) -> Array:
    """(4, n) harmonics of orbits beyond A_c; of nearly round ones in closed form.

    On a circle the force is constant and lags by arccos(1 / A): A c = 1 / A, A b = sqrt(1 - 1 / A^2). With x = pi -
    theta, x_c at A_c, the second one is that times sqrt(1 - (x_c / x)^2) next to the circle, to the order of 1 - B / A.
    """
    x, end = (2 * np.arctan(np.sqrt(a - 1)) for a in (A, _longest_sticking(B / A)))
    less = np.sqrt(np.maximum(1 - (end / x) ** 2, 0.0))
    one = np.stack([1 / A, np.sqrt(1 - A**-2.0) * less])
    found = np.concatenate([one, one * B / A])
    other = B < (1 - ROUND) * A
    if other.any():
        found[:, other] = sliding(A[other], B[other])[0]
    return found


# Where sticking ends -----------------------------------------------------------------------------------------------


def shape(e: jax.Array, round_: jax.Array) -> jax.Array:
    """Coordinate from 0 (a line) to 1 (a circle) of the share e = B / A; round_ = 1 - e, not to lose its digits."""
    p, q = jnp.cbrt(e), jnp.sqrt(jnp.sqrt(round_))
    return p / (p + q)


def _shares(s: Array) -> Array:
    """e of the coordinates s: the inverse of `shape`."""
    low, high = np.zeros_like(s), np.ones_like(s)
    for _ in range(60):
        e = 0.5 * (low + high)
        up = np.cbrt(e) * (1 - s) < s * (1 - e) ** 0.25
        low, high = np.where(up, e, low), np.where(up, high, e)
    return np.clip(np.where(s >= 1, 1.0, 0.5 * (low + high)), THINNEST, 1.0)


_EDGE: dict[str, Array] = {}


def _edge() -> Array:
    """Coefficients of rho(s), by which tan(theta_c / 2) = rho e / sqrt(1 - e) with A_c = 1 / sin^2(theta_c / 2).

    Found by halving. Very thin ellipses follow the law rho / sqrt(1 - e) = a + b e^2 of those that can be computed.
    """
    if "rho" not in _EDGE:
        e = _shares(np.linspace(0.0, 1.0, 129))
        computed = (e > 0.04) & (e < 1 - ROUND)
        inside = e[computed]
        low, high = np.full(inside.shape, 1.38), np.full(inside.shape, 2.2)
        for _ in range(20):
            rho = 0.5 * (low + high)
            A = 1 + (1 - inside) / (rho * inside) ** 2
            _, least, left = sliding(A, inside * A, 256, 8)
            never = (least > 0) & (left < 1e-6)
            low, high = np.where(never, rho, low), np.where(never, high, rho)
        rho = np.sqrt(2.0) + 0.57 * (1 - e)  # next to the circle
        rho[computed] = 0.5 * (low + high)
        first = np.flatnonzero(computed)[:6]
        line = np.polyfit(e[first] ** 2, rho[first] / np.sqrt(1 - e[first]), 1)
        thin = e <= 0.04
        rho[thin] = np.polyval(line, e[thin] ** 2) * np.sqrt(1 - e[thin])
        _EDGE["rho"] = rho
    return _EDGE["rho"]


def _longest_sticking(e: Array) -> Array:
    """A_c of shares e: the half-axis beyond which the slider never sticks."""
    e = np.clip(e, THINNEST, 1.0)
    table = Orbits(jnp.zeros((2, 4, 6, 6)), jax.device_put(_edge_spline(_edge())))
    return 1 / np.sin(0.5 * np.asarray(table.last(jax.device_put(e), jax.device_put(1 - e)))) ** 2


def _edge_spline(rho: Array) -> Array:
    """Coefficients (1, n + 2, 6) as a `Spline` in s that does not depend on its second variable."""
    along = fitted(np.repeat(rho[:, None], 4, axis=1), ((False, False), (True, True)))
    return along[None]


# The table ---------------------------------------------------------------------------------------------------------


@settings
class Orbits:
    """The stiffnesses of all elliptic orbits.

    Attributes:
        coefficients: (2, 4, p, p) splines of A K_eta and A K_zeta, real and imaginary parts, of orbits with and without
            sticking. edge: (1, q, 6) spline of rho(s), see `_edge`.
    """

    coefficients: jax.Array
    edge: jax.Array

    def last(self, e: jax.Array, round_: jax.Array) -> jax.Array:
        """theta_c of A_c = 1 / sin^2(theta_c / 2)."""
        rho = Spline(self.edge[:, None]).at(shape(e, round_), jnp.zeros_like(e))[0]
        return 2 * jnp.arctan2(rho * e, jnp.sqrt(round_))

    def forces(self, A: jax.Array, e: jax.Array, round_: jax.Array) -> tuple[jax.Array, jax.Array]:
        """A K_eta and A K_zeta (complex, any shape) of orbits with half-axes A > 1 and e A.

        Args:
            round_: 1 - e, to all of its digits.
        """
        flat = tuple(jnp.ravel(x) for x in (A, e, round_))
        found = self._flat(*flat).reshape(4, *jnp.shape(A))
        return found[0] + 1j * found[1], found[2] + 1j * found[3]

    def _flat(self, A: jax.Array, e: jax.Array, round_: jax.Array) -> jax.Array:
        A, e, round_ = jnp.clip(A, 1 + 1e-12, LONGEST), jnp.maximum(e, THINNEST), jnp.maximum(round_, 1e-16)
        x = 2 * jnp.arctan(jnp.sqrt(A - 1))  # pi - theta
        end = np.pi - self.last(e, round_)
        sticks = x < end
        share = jnp.where(sticks, x / jnp.where(sticks, end, 1.0), 0.5)
        before = 1 - jnp.sqrt(jnp.maximum(1 - share, 1e-14))
        beyond = jnp.where(sticks, 0.5, (x - end) / (np.pi - end))
        after = jnp.sqrt(jnp.maximum(beyond, 1e-14))
        t = jnp.where(sticks, before, after)
        return Spline(self.coefficients).at(shape(e, round_), t, jnp.where(sticks, 0, 1))


def _nodes(s: Array, t: Array) -> Array:
    """(2, 4, p, q) A K_eta, A K_zeta at the nodes of both tables."""
    e = _shares(s)
    end = 2 * np.arcsin(1 / np.sqrt(_longest_sticking(e)))
    end[s >= 1] = np.pi
    x = np.stack([(np.pi - end)[:, None] * t * (2 - t), np.pi - end[:, None] * (1 - t**2)])
    A = np.clip(1 / np.maximum(np.cos(0.5 * x), 1e-9) ** 2, 1 + 1e-13, LONGEST)
    E = np.broadcast_to(e[:, None], A.shape)
    found = np.zeros((4, *A.shape))
    never = (A < 50) & (np.arange(2)[:, None, None] == 1) | (E == 1.0)
    found[:, never] = _never_sticking(A[never], (E * A)[never])
    found[:, ~never] = sticking(A[~never], (E * A)[~never])
    found[2:] /= E
    return np.moveaxis(found, 0, 1)


def _worth(difference: Array, s: Array, t: Array) -> Array:
    """Differences of the force over what friction holds: along zeta the orbit is shorter by e."""
    e = _shares(s)[:, None]
    return np.abs(difference) * np.stack([np.ones_like(e), np.ones_like(e), e, e])


FLAT = (((False, True), (True, False)), ((False, True), (True, False)))
"""At the slip limit, on a circle and where sticking ends the functions are even in the coordinates of the table."""


KIND, LAW = "ellipse", "stiffness 1, limit 1"
SHIPPED = Path(__file__).with_name("ellipse.npz")
"""The table to `TOLERANCE`, written by `make`: it depends on no law, so that nobody needs to wait for it."""


def make(tolerance: float = TOLERANCE) -> Table:
    """Compute the table (some seconds)."""
    parts, left = refined(_nodes, _worth, FLAT, tolerance, (49, 65, 97))
    arrays = {"coefficients": parts, "edge": _edge_spline(_edge())}
    error, typical = float(left.max()), float(np.quantile(left, 0.99))
    return Table(KIND, LAW, arrays, error, typical, tolerance, left[:, 0].size)


def orbits(tolerance: float = TOLERANCE, where: Path | None = None) -> tuple[Orbits, Table]:
    """The table and what is known of its error: the one that comes with the package, or a finer one.

    Args:
        where: folder in which finer ones are kept.

    Raises:
        UserError: the package's own table is damaged.
    """
    if tolerance >= TOLERANCE:
        table = read(SHIPPED, KIND, LAW)
    else:
        table = kept(KIND, LAW, tolerance, lambda: make(tolerance), where)
    return Orbits(*(jax.device_put(table.arrays[name]) for name in ("coefficients", "edge"))), table
