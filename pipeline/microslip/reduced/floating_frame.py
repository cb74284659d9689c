"""One elastic body in large rigid motion: the floating frame of reference (Sextro 2.1 to 2.3), integrated in time.

The frame A moves with the body, x + u = r + phi q seen from its point R (the modal file's `rotation/point`). With the
integrals of `data.Invariants`, components in A throughout, Sextro Eqs. (2.3-21) to (2.3-25) read

    [ m      -c~    S  ] [ a_R   ]   [ -w~w~ c - 2 w~ S q'                              ]   [ f ]
    [ c~      I     h  ] [ alpha ] = [ -w x I w - 2 integral of rho (r + u) x (w x u')  ] + [ t ]
    [ S^T    h^T   M_r ] [ q''   ]   [ -integral of rho phi^T (w~w~ (r+u) + 2 w~ u') - K q - C q' ] + [ Q ]

with c = integral of rho (r + u), I the inertia about R, S of rho phi, h of rho (r + u) x phi. Nothing is small but
the strains and the deflection q; pure numpy and scipy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.integrate

from ..data import Array, Invariants, ModalBasis
from ..errors import NotConverged, UserError
from ..frames import skew
from .coordinates import in_modes, with_modes

OfTime = Callable[[float], float]
_LEVI_CIVITA = np.zeros((3, 3, 3))
_LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


@dataclass(frozen=True)
class FloatingBody:
    """What moves.

    Attributes:
        invariants: about R, on the elastic modes that are kept. K, C: (m, m) elastic and damping matrix, s^-2, 1/s;
            K without any centrifugal softening. pull: (m,) elastic force of the state the modes are taken about.
        speed: rad/s of that state. axis: (3,) its unit vector. phi: (n, 3, m). u_static: (n, 3) m.
        stiffened: whether inertia forces stiffen it (`Invariants.stiffening`).
    """

    invariants: Invariants
    K: Array
    C: Array
    pull: Array
    speed: float
    axis: Array
    phi: Array
    u_static: Array
    stiffened: bool

    @property
    def n_modes(self) -> int:
        return len(self.K)


@dataclass(frozen=True)
class SpinUp:
    """Prescribed rotation about a fixed axis. time: (t,) s. speed: (t,) rad/s. q, velocity: (t, m)."""

    time: Array
    speed: Array
    q: Array
    velocity: Array


@dataclass(frozen=True)
class Flight:
    """Free motion.

    Attributes:
        time: (t,) s. position: (t, 3) of R, m, inertial. attitude: (t, 3, 3) A with x_inertial = A x_body. velocity:
            (t, 3) of R, m/s, and angular_velocity: (t, 3), rad/s, in body axes. q, q_velocity: (t, m).
    """

    time: Array
    position: Array
    attitude: Array
    velocity: Array
    angular_velocity: Array
    q: Array
    q_velocity: Array


def floating_body(basis: ModalBasis, speed: int = 0, stiffened: bool = True) -> FloatingBody:
    """One speed group of a modal file as a floating body; rigid modes are left to the frame.

    Args:
        speed: index of the group. stiffened: whether inertia forces stiffen it.

    Raises:
        UserError: a cyclic sector, or stiffening that the file does not hold.
    """
    if (speed, 0) not in basis.groups:
        raise UserError(f"speed {speed}: the modal file holds {len(basis.groups)} groups; choose a lower number")
    g = in_modes(basis.groups[speed, 0])
    if g.invariants is None or g.run_up is None:
        raise UserError(f"{basis.name}: a cyclic sector has no inertia invariants; mesh the whole body")
    if stiffened and not len(g.invariants.stiffening):
        raise UserError(
            f"{basis.name}: the modal file does not hold how rigid motion stiffens the body; set stiffening = true in "
            "[output] and compute it again, or say stiffened=False"
        )
    keep = np.flatnonzero(g.omega > 0)
    some, invariants = np.ix_(keep, keep), with_modes(g.invariants, keep)
    soft = g.speed**2 * g.run_up.P if g.spin_softening else 0 * g.run_up.P
    return FloatingBody(
        invariants, (g.K_r + soft)[some], g.C_r[some], g.speed**2 * g.run_up.centrifugal[keep], g.speed,
        basis.rotation_axis, g.phi[:, :, keep] if g.phi.shape[0] else g.phi, g.u_static, stiffened,
    )  # fmt: skip


# the integrals at a deflection ------------------------------------------------------------------------------------


def first_moment(b: FloatingBody, q: Array) -> Array:
    """(3,) c = integral of rho (r + u), kg m."""
    return b.invariants.first_moment + b.invariants.shape @ q


def moment_shape(b: FloatingBody, q: Array) -> Array:
    """(3, 3, m) integral of rho (r + u)_a phi_b, kg^1/2 m."""
    return b.invariants.position_shape + np.tensordot(b.invariants.shape_shape, q, axes=(2, 0))


def inertia(b: FloatingBody, q: Array) -> Array:
    """(3, 3) inertia about R, kg m^2."""
    Xq = b.invariants.position_shape @ q
    D = b.invariants.second_moment + Xq + Xq.T + np.einsum("abij,i,j->ab", b.invariants.shape_shape, q, q)
    return np.trace(D) * np.eye(3) - D


def rotation_shape(Z: Array) -> Array:
    """(3, m) h = integral of rho (r + u) x phi from that of (r + u)_a phi_b."""
    return np.einsum("cab,abj->cj", _LEVI_CIVITA, Z)


def mass_matrix(b: FloatingBody, q: Array) -> Array:
    """(6 + m, 6 + m) of Sextro Eq. (2.3-23) with q for the deformation (errata: the (2,2) block is positive)."""
    c, h, v = skew(first_moment(b, q)), rotation_shape(moment_shape(b, q)), b.invariants
    M_r = np.einsum("aaij->ij", v.shape_shape)
    return np.block([[v.mass * np.eye(3), -c, v.shape], [c, inertia(b, q), h], [v.shape.T, h.T, M_r]])


def stiffening(b: FloatingBody, w: Array, a: Array, alpha: Array) -> Array:
    """(m, m) geometric stiffness of the inertia forces beyond those of the state the modes are taken about.

    Args:
        w: angular velocity, rad/s. a: acceleration of R, m/s2. alpha: rad/s2; all in body axes.
    """
    if not b.stiffened:
        return np.zeros_like(b.K)
    W = np.outer(w, w) - b.speed**2 * np.outer(b.axis, b.axis)
    products = [W[0, 0], W[1, 1], W[2, 2], W[0, 1], W[1, 2], W[0, 2]]
    return np.tensordot(np.concatenate([products, a, alpha]), b.invariants.stiffening, axes=1)


def right_side(b: FloatingBody, w: Array, q: Array, velocity: Array) -> Array:
    """(6 + m,) of the equations above without outer forces; the stiffening is that of w alone."""
    v, Z = b.invariants, moment_shape(b, q)
    spin = skew(w)
    square = spin @ spin
    rate = Z @ velocity  # integral of rho (r + u)_a u'_b
    force = -square @ first_moment(b, q) - 2 * spin @ (v.shape @ velocity)
    torque = -np.cross(w, inertia(b, q) @ w) - 2 * (w * np.trace(rate) - rate.T @ w)
    G = 2 * np.einsum("ab,abij->ij", spin, v.shape_shape)
    zero = np.zeros(3)
    elastic = (b.K + stiffening(b, w, zero, zero)) @ q + b.pull + b.C @ velocity
    return np.concatenate([force, torque, -np.einsum("ab,abj->j", square, Z) - G @ velocity - elastic])


# conserved quantities ---------------------------------------------------------------------------------------------


def energy(b: FloatingBody, v: Array, w: Array, q: Array, velocity: Array) -> float:
    """Kinetic and strain energy, J (without stiffening, whose forces have no potential). v: of R, body axes."""
    y = np.concatenate([v, w, velocity])
    return float(0.5 * y @ mass_matrix(b, q) @ y + 0.5 * q @ b.K @ q + b.pull @ q)


def momentum(b: FloatingBody, v: Array, w: Array, q: Array, velocity: Array) -> tuple[Array, Array]:
    """Linear momentum, N s, and angular momentum about R, N m s, in body axes."""
    y = np.concatenate([v, w, velocity])
    p = mass_matrix(b, q)[:6] @ y
    return p[:3], p[3:]


# motions ----------------------------------------------------------------------------------------------------------


def spin_up(
    b: FloatingBody, speed: OfTime, acceleration: OfTime, times: Array, load: Callable[[float], Array] | None = None,
    tolerance: float = 1e-7,
) -> SpinUp:  # fmt: skip
    """The elastic motion while the frame turns about its fixed axis as prescribed, from the undeflected state.

    Linear in q with coefficients that follow the speed (see `data.RunUp`); integrated by Radau's method.

    Args:
        speed, acceleration: Omega(t) rad/s, its derivative. times: (t,) s where the answer is wanted, ascending.
        load: t -> (m,) generalised forces. tolerance: relative, of the integration.

    Raises:
        NotConverged: the integration failed.
    """
    v, n, m = b.invariants, b.axis, b.n_modes
    turn, zero = skew(n), np.zeros(3)
    N = np.einsum("ab,abij->ij", turn, v.shape_shape)
    P = -np.einsum("ab,abij->ij", turn @ turn, v.shape_shape)
    pull = -np.einsum("ab,abj->j", turn @ turn, v.position_shape)
    euler = -n @ rotation_shape(v.position_shape)
    M_r = np.einsum("aaij->ij", v.shape_shape)
    inverse = np.linalg.inv(M_r)

    def matrices(t: float) -> tuple[Array, Array]:
        W, alpha = speed(t), acceleration(t)
        K = b.K - W**2 * P + alpha * N + stiffening(b, W * n, zero, alpha * n)
        return -inverse @ K, -inverse @ (b.C + 2 * W * N)

    def slope(t: float, y: Array) -> Array:
        K, C = matrices(t)
        force = speed(t) ** 2 * pull - b.pull + acceleration(t) * euler + (0 if load is None else load(t))
        return np.concatenate([y[m:], K @ y[:m] + C @ y[m:] + inverse @ force])

    def jacobian(t: float, y: Array) -> Array:
        K, C = matrices(t)
        return np.block([[np.zeros((m, m)), np.eye(m)], [K, C]])

    size = float(np.abs(np.linalg.solve(b.K, euler)).max()) + 1e-12
    absolute = tolerance * size * np.concatenate([np.ones(m), np.full(m, np.sqrt(np.diag(b.K).min()))])
    done = scipy.integrate.solve_ivp(
        slope, (times[0], times[-1]), np.zeros(2 * m), "Radau", times, rtol=tolerance, atol=absolute, jac=jacobian
    )
    if not done.success:
        raise NotConverged(f"the spin-up stopped at {done.t[-1] if len(done.t) else times[0]:g} s: {done.message}")
    return SpinUp(done.t, np.array([speed(t) for t in done.t]), done.y[:m].T, done.y[m:].T)


def flight(
    b: FloatingBody, times: Array, angular_velocity: Array, velocity: Array | None = None, q: Array | None = None,
    q_velocity: Array | None = None, tolerance: float = 1e-10,
) -> Flight:  # fmt: skip
    """Free motion from a state at times[0], the frame at the origin and parallel to the inertial axes.

    Args:
        angular_velocity, velocity: (3,) rad/s and m/s of R, body axes. q, q_velocity: (m,). tolerance: relative.

    Raises:
        NotConverged: the integration failed.
    """
    m = b.n_modes
    zero = np.zeros(m)
    start = np.concatenate(
        [
            np.zeros(3), [1.0, 0, 0, 0], np.zeros(3) if velocity is None else velocity, angular_velocity,
            zero if q is None else q, zero if q_velocity is None else q_velocity,
        ]
    )  # fmt: skip

    def slope(t: float, y: Array) -> Array:
        e, v, w, deflection, rate = y[3:7], y[7:10], y[10:13], y[13 : 13 + m], y[13 + m :]
        found = np.linalg.solve(mass_matrix(b, deflection), right_side(b, w, deflection, rate))
        change = 0.5 * np.concatenate([[-w @ e[1:]], e[0] * w + np.cross(e[1:], w)])
        return np.concatenate([attitude(e) @ v, change, found[:3] - np.cross(w, v), found[3:6], rate, found[6:]])

    done = scipy.integrate.solve_ivp(
        slope, (times[0], times[-1]), start, "DOP853", times, rtol=tolerance, atol=tolerance * 1e-3
    )
    if not done.success:
        raise NotConverged(f"the flight stopped: {done.message}")
    y = done.y.T
    A = np.array([attitude(e) for e in y[:, 3:7]])
    return Flight(done.t, y[:, :3], A, y[:, 7:10], y[:, 10:13], y[:, 13 : 13 + m], y[:, 13 + m :])


def attitude(e: Array) -> Array:
    """(3, 3) rotation of a quaternion (scalar first), made a unit one: x_inertial = A x_body."""
    s, v = e[0] / np.linalg.norm(e), e[1:] / np.linalg.norm(e)
    return (s**2 - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * s * skew(v)
