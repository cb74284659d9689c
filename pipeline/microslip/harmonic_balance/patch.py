"""A rigid contact patch of point contacts: kinematics, equilibrium under given forces, harmonics of its resultants.

Both bodies move as rigid ones over the patch (Sextro Eq. (5.2-2)), so six coordinates u_O = [u_n, u_t1, u_t2, phi_n,
phi_t1, phi_t2] carry all of its points. Forces and their derivatives are found point by point, in the three directions
of a point, and contracted with the kinematics afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.harmonics import force_harmonics, waves
from ..contact.law import Law, State, cycles
from ..contact.point import PointContact
from ..data import Array, NotConverged, UserError


@dataclass(frozen=True)
class Patch:
    """Point contacts of one interface against a rigid neighbour.

    Attributes:
        interface: name. points: (n, 2) places along t1 and t2 from the patch's origin, m. areas: (n,) m2.
        law: contact law of the points, its extensive numbers those of one point.
    """

    interface: str
    points: Array
    areas: Array
    law: Law

    @property
    def kinematics(self) -> Array:
        """(n, 3, 6) displacement of every point per unit of the six coordinates (Sextro Eq. (5.2-4)).

        u_M = u_O + phi x r with r = (0, y, z): y along t1, z along t2.
        """
        y, z = self.points.T
        G = np.zeros((len(y), 3, 6))
        G[:, :, :3] = np.eye(3)
        G[:, 0, 4], G[:, 0, 5] = z, -y
        G[:, 1, 3], G[:, 2, 3] = -z, y
        return G


def grid(width: float, height: float, counts: tuple[int, int]) -> tuple[Array, Array]:
    """(n, 2) centres and (n,) areas of n_y x n_z equal rectangles of a patch b0 x h0, m (Sextro Eq. (5.2-1))."""
    y, z = ((np.arange(k) + 0.5) / k - 0.5 for k in counts)
    centres = np.stack(np.meshgrid(width * y, height * z, indexing="ij"), axis=-1).reshape(-1, 2)
    return centres, np.full(len(centres), width * height / len(centres))


def equilibrium(patch: Patch, normal: float, moments: tuple[float, float] = (0.0, 0.0)) -> Array:
    """(6,) coordinates at which the patch carries a normal force (N) and moments about t1 and t2 (N m).

    Sextro Eq. (5.2-5) in physical units, friction left out (the factor 1/(n_y n_z) that is missing there is in the
    numbers of the law, those of one point). Newton's method from an approach that presses harder than asked.

    Raises:
        UserError: a normal force that is negative, or that the law reaches at no approach.
        NotConverged: moments that tilt the patch off the neighbour.
    """
    if normal < 0:
        raise UserError(f"normal force: {normal:g} N; a contact cannot pull, give 0 or more")
    asked = np.array([normal, *moments])
    u = np.zeros(6)
    if np.allclose(_pressed(patch, u)[0], asked, rtol=1e-12, atol=0.0):
        return u
    if normal == 0:
        return u
    u[0] = _deep_enough(patch, normal)
    half = np.append(1.0, np.maximum(np.abs(patch.points).max(axis=0)[::-1], 1e-3))  # rims that phi_t1, phi_t2 lift
    for _ in range(100):
        force, K = _pressed(patch, u)
        excess = (force - asked) / half
        if np.abs(excess).max() <= 1e-12 * normal:
            return u
        step = np.linalg.lstsq(K / np.outer(half, half), -excess, rcond=1e-13)[0] / half
        u[[0, 4, 5]] += step * _kept(patch, u, step, asked, half)
    raise NotConverged(f"{patch.interface}: no equilibrium under {normal:g} N and moments of {moments} N m was found")


def _kept(patch: Patch, u: Array, step: Array, asked: Array, half: Array) -> float:
    """The longest of 1, 1/2, 1/4, ... of a Newton step that brings the forces nearer to those asked for."""
    before = np.linalg.norm((_pressed(patch, u)[0] - asked) / half)
    for share in 0.5 ** np.arange(12):
        trial = u.copy()
        trial[[0, 4, 5]] += share * step
        if np.linalg.norm((_pressed(patch, trial)[0] - asked) / half) < before:
            return float(share)
    return float(share)


def _deep_enough(patch: Patch, normal: float) -> float:
    """A pure approach (m) whose force is not below the one asked for."""
    u = np.zeros(6)
    for u[0] in 1e-9 * 2.0 ** np.arange(30):
        if _pressed(patch, u)[0][0] >= normal:
            return float(u[0])
    raise UserError(f"{patch.interface}: no approach below {u[0]:.2g} m makes a normal force of {normal:g} N")


def _pressed(patch: Patch, u: Array) -> tuple[Array, Array]:
    """(3,) normal force and moments about t1 and t2 at (6,) coordinates, and (3, 3) their derivative."""
    G = patch.kinematics[:, 0][:, [0, 4, 5]]
    approach = jnp.asarray(G @ u[[0, 4, 5]])
    force, slope = _normal(patch.law, approach)
    return G.T @ np.asarray(force), G.T @ (np.asarray(slope)[:, None] * G)


@jax.jit
def _normal(law: Law, approach: jax.Array) -> tuple[jax.Array, jax.Array]:
    def force(u: jax.Array) -> jax.Array:
        path = jnp.stack([u, jnp.zeros_like(u), jnp.zeros_like(u)], axis=1)
        return law.step(path, jnp.zeros_like(path), 1.0, law.init(len(u)))[0][:, 0]

    return jax.jvp(force, (approach,), (jnp.ones_like(approach),))


def stuck_stiffness(patch: Patch, u: Array) -> Array:
    """(6, 6) tangent of the patch about (6,) coordinates, every point sticking (Sextro Eq. (5.2-32), linear)."""
    G = patch.kinematics
    return np.einsum("nia,nij,njb->ab", G, np.asarray(_tangent(patch.law, jnp.asarray(G @ u))), G)


@jax.jit
def _tangent(law: Law, u: jax.Array) -> jax.Array:
    """(n, 3, 3) derivative of the force for a small motion from a loaded state without tangential force."""
    at_rest = u.at[:, 1:].set(0.0)
    state = law.step(at_rest, jnp.zeros_like(u), 1.0, law.init(len(u)))[1]

    def moved(direction: jax.Array) -> jax.Array:
        whole = jnp.broadcast_to(direction, u.shape)
        return jax.jvp(lambda x: law.step(x, jnp.zeros_like(x), 1.0, state)[0], (at_rest,), (whole,))[1]

    return jnp.moveaxis(jax.vmap(moved)(jnp.eye(3)), 0, 2)


@partial(jax.jit, static_argnames=("samples", "count"))
def resultants(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, samples: int, count: int
) -> tuple[jax.Array, jax.Array]:
    """Harmonics of the six resultants and their derivative (Sextro Eqs. (5.2-31), (5.2-32), any number of harmonics).

    Args:
        law: of n points. G: (n, 3, 6) kinematics. u: (6, 2 H + 1) mean, cos, sin, cos 2, ... period: s.
        samples: of a cycle. count: cycles marched, the last one is transformed.

    Returns:
        (6, 2 H + 1) N and N m, and (6, 2 H + 1, 6, 2 H + 1).
    """
    force, slope = force_harmonics(law, jnp.einsum("nia,ak->nik", G, u), period, samples, count)
    half = jnp.einsum("nia,nikjl->najkl", G, slope)
    return jnp.einsum("nia,nik->ak", G, force), jnp.einsum("najkl,njb->akbl", half, G)


@partial(jax.jit, static_argnames=("samples", "count"))
def resultants_alone(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, samples: int, count: int
) -> jax.Array:
    """`resultants` without the derivative: (6, 2 H + 1)."""
    values, transform = waves(u.shape[1] // 2, samples)
    force, _ = cycles(law, jnp.einsum("sk,nia,ak->sni", values, G, u), period, count)
    return jnp.einsum("ks,nia,sni->ak", transform, G, force)


@partial(jax.jit, static_argnames=("samples", "count"))
def rate(law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, samples: int, count: int) -> jax.Array:
    """(6, 2 H + 1) derivative of the resultants with respect to the period, N/s."""
    return jax.jvp(lambda T: resultants_alone(law, G, u, T, samples, count), (period,), (jnp.ones(()),))[1]


def needs_rate(law: Law) -> bool:
    """Whether the force depends on the speed of the motion, and not on its path alone."""
    return not (isinstance(law, PointContact) and law.friction.constant and law.damping is None)


class Cycle(NamedTuple):
    """What the n points of a patch do in one cycle.

    Attributes:
        dissipated: (n,) J, work done on the points. by_slip: (n,) J, friction force times the path slid; without what
            area that opens under load takes with it. slipping, open: (n,) share of the cycle.
        unsteady: largest change of a resultant's sample against the cycle before, over the largest resultant force.
    """

    dissipated: Array
    by_slip: Array
    slipping: Array
    open: Array
    unsteady: float


def watch(law: Law, G: Array, u: Array, period: float, samples: int, count: int) -> Cycle:
    """One more cycle than `resultants` marches, looked at in time. Arguments: see there."""
    parts = _watched(law, jnp.asarray(G), jnp.asarray(u), period, samples, count)
    dissipated, by_slip, slipping, open_ = (np.asarray(p) for p in parts[:4])
    return Cycle(dissipated, by_slip, slipping, open_, float(parts[4]))


@partial(jax.jit, static_argnames=("samples", "count"))
def _watched(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, samples: int, count: int
) -> tuple[jax.Array, ...]:
    values, _ = waves(u.shape[1] // 2, samples)
    path = jnp.einsum("sk,nia,ak->sni", values, G, u)
    before, state = cycles(law, path, period, count)
    speed = (path - jnp.roll(path, 1, axis=0)) * (samples / period)

    def one(state: State, sample: tuple[jax.Array, jax.Array]) -> tuple[State, tuple[jax.Array, jax.Array]]:
        force, after = law.step(sample[0], sample[1], period / samples, state)
        return after, (force, law.slip(after) - law.slip(state))

    _, (force, slid) = jax.lax.scan(one, state, (path, speed))
    mean = 0.5 * (force + jnp.roll(force, 1, axis=0))
    moved = path - jnp.roll(path, 1, axis=0)
    open_ = force[..., 0] <= 0
    least = 1e-9 * jnp.abs(moved).max()
    slips = (jnp.abs(slid).max(axis=-1) > least) & ~open_
    change = jnp.einsum("nia,sni->sa", G, force - before)[:, :3]
    size = jnp.abs(jnp.einsum("nia,sni->sa", G, force)[:, :3]).max()
    unsteady = jnp.where(size > 0, jnp.abs(change).max() / jnp.where(size > 0, size, 1.0), 0.0)
    by_slip = jnp.sum(mean[..., 1:] * slid, axis=(0, 2))
    return jnp.sum(mean * moved, axis=(0, 2)), by_slip, slips.mean(axis=0), open_.mean(axis=0), unsteady
