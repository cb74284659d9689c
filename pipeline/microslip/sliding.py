"""An assembly about sliding: smooth equations of first order, their equilibrium, and what they are linearised there.

With the coordinates q of all bodies, v = q' and x, what the contacts' laws remember in their differential equations
(`contact.law.Law.rates`),

    q' = v,  v' = f - C v - K q - P^T F(P q + u_0, P v - V),  x' by the laws,

P moves the points of the contacts, which stand at u_0 otherwise, V is the velocity of the ground under each, and f
holds what presses them. Squeal asks whether the equilibrium is stable, bifurcation what
follows if it is not; both begin here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from .data import Array
from .errors import NotConverged, UserError
from .process import prepare
from .system.assembly import Assembly, Contact


class Points(NamedTuple):
    """Points of one kind of law. law: of n points. moved: (n, 3, m) their motion by the coordinates. at: (n, 3) where
    they stand without it. ground: (n, 3) m/s of it under them."""

    law: Any
    moved: Any
    at: Any
    ground: Any


class Sliding(NamedTuple):
    """The equations of an assembly in coordinates in which M = 1, a tree of numbers in jax.

    Attributes:
        C, K: (m, m). push: (m,) steady forces and preload. points: of the contacts, by kinds. output: (w, m).
        harmonics: (H,) of what drives it, cosine, sine: (H, m). shapes: (m, m) coordinates of the assembly per own one.
    """

    C: Any
    K: Any
    push: Any
    points: tuple[Points, ...]
    output: Any
    harmonics: Any
    cosine: Any
    sine: Any
    shapes: Any

    @property
    def memory(self) -> list[tuple[int, int]]:
        """(k, n) numbers and points of each kind."""
        return [(p.law.remembers or 0, len(p.at)) for p in self.points]

    @property
    def order(self) -> int:
        """Of q, v and x."""
        return 2 * int(np.shape(self.push)[0]) + sum(k * n for k, n in self.memory)


def of(assembly: Assembly, like: Array | None = None) -> Sliding:
    """The equations of an assembly; a sector that stands for a ring is unrolled.

    Args:
        like: `points_moved` of another assembly, in whose coordinates it is to be written: those of a body that a
            parameter changes would turn with it.

    Raises:
        UserError: a contact that is not smooth, wavy ground, modes that are not real, compliance beside the modes;
            bodies that move by other shapes than the other assembly's, or have loss factors.
    """
    prepare()
    assembly = assembly.unrolled()
    assembly.check_names()
    harmonics = sorted({x.harmonic for x in assembly.loads if x.harmonic})
    mean, driven = assembly.joined(0), [assembly.joined(h) for h in harmonics]
    if np.abs(mean.residual).max(initial=0.0) > 0:
        raise UserError(
            "sliding: the modes leave compliance out beside the contacts, which has no equation of its own; take a "
            "modal file without residual compliance"
        )
    vibrating = assembly.joined(1)
    if (loss := vibrating.loss) is not None and np.any(loss):
        raise UserError('damping: loss factors have no equation in time; write damping = "modal", or give dampers')
    T = _turn(points_moved(assembly), like)
    T = T @ np.linalg.inv(np.linalg.cholesky(T.T @ _real(mean.M) @ T)).T
    D = _real(mean.rows) @ T
    preload = np.concatenate([np.zeros(0), *(c.preload for c in assembly.contacts)])
    loads = np.array([p.load for p in driven], dtype=complex).reshape(len(harmonics), len(T)) @ T
    first = T.T @ _real(vibrating.C) @ T, T.T @ _real(vibrating.K) @ T, _real(mean.load) @ T + preload @ D
    rest = _real(mean.output) @ T, np.array(harmonics, dtype=float), loads.real, -loads.imag, T
    C, K, push = map(jnp.asarray, first)
    return Sliding(C, K, push, _points(assembly.contacts, D), *map(jnp.asarray, rest))


def _points(contacts: Sequence[Contact], D: Array) -> tuple[Points, ...]:
    """Of all contacts, those of one kind of law together. D: (c, m)."""
    found: dict[Any, list[Points]] = {}
    begin = 0
    for c in contacts:
        law, n, G = c.patch.law, len(c.patch.points), c.patch.kinematics
        if not law.smooth:
            raise UserError(
                f"contacts.{c.name}: its law, {type(getattr(law, 'whole', law)).__name__}, cannot be "
                'linearised where it slides; take friction by the velocity alone (law = { kind = "rate", slope = ... })'
            )
        own = G @ D[begin : begin + c.patch.count]
        leaves, tree = jax.tree_util.tree_flatten(law)
        scalar = all(np.ndim(leaf) == 0 or np.shape(leaf) == (n,) for leaf in leaves)
        law = jax.tree_util.tree_map(lambda x, n=n: np.broadcast_to(x, n), law) if scalar else law
        found.setdefault(tree if scalar else c.name, []).append(Points(law, own, G @ c.offset, _ground(c)))
        begin += c.patch.count
    return tuple(jax.tree_util.tree_map(lambda *x: jax.device_put(np.concatenate(x)), *same) if len(same) > 1
                 else jax.tree_util.tree_map(jnp.asarray, same[0]) for same in found.values())  # fmt: skip


def points_moved(assembly: Assembly) -> Array:
    """(3 n, m) displacements of all points of the bodies per unit of each coordinate; of a structure of matrices, which
    has no points, its coordinates."""
    groups = [next(iter(c.groups.values())) for c in assembly.unrolled().components]
    phi = [g.phi.reshape(-1, g.phi.shape[-1]) if g.phi.size else np.eye(g.phi.shape[-1]) for g in groups]
    return np.asarray(scipy.linalg.block_diag(*phi))


def _turn(own: Array, like: Array | None) -> Array:
    """(m, m) coordinates per unit of those of the other shapes."""
    if like is None or (own.shape == like.shape and np.array_equal(own, like)):
        return np.eye(own.shape[1])
    T = np.linalg.lstsq(own, like, rcond=1e-12)[0] if own.shape == like.shape else np.zeros(2 * own.shape[1:])
    if own.shape != like.shape or np.abs(own @ T - like).max(initial=0.0) > 1e-9 * np.abs(like).max(initial=0.0):
        raise UserError("sliding: the shapes of the bodies change with the parameter; take one that leaves them as is")
    return T


def _real(values: Array) -> Array:
    if np.abs(np.imag(values)).max(initial=0.0) > 1e-9 * np.abs(values).max(initial=0.0):
        raise UserError("sliding: a body has complex modes, which real equations cannot take; leave the flow out")
    return np.real(values)


def _ground(contact: Contact) -> Array:
    """(n, 3) m/s under the points."""
    found = np.zeros((len(contact.patch.points), 3))
    if (ground := contact.ground) is not None:
        if ground.waves:
            raise UserError(f"contacts.{contact.name}.ground: wavy ground has no equilibrium; leave waviness out")
        found[:, 1:] = ground.velocities(contact.patch.points)
    return found


def rate(s: Sliding, z: Any, angle: Any = 0.0) -> Any:
    """z' of z = (q, v, x), at an angle (rad) of what drives it."""
    m = s.push.shape[0]
    q, v, at = z[:m], z[m : 2 * m], 2 * m
    total, remembered = s.push - times(s.C, v) - times(s.K, q), list[Any]()
    if len(s.harmonics):
        turned = jnp.asarray(angle) * s.harmonics
        total = total + times(s.cosine.T, jnp.cos(turned)) + times(s.sine.T, jnp.sin(turned))
    for p, (k, n) in zip(s.points, s.memory, strict=True):
        u, w, x = p.at + times(p.moved, q), times(p.moved, v) - p.ground, z[at : at + k * n].reshape(k, n)
        force, change = p.law.rates(u, w, x, 0.0, 0.0)
        total = total - times(p.moved.reshape(-1, m).T, force.reshape(-1))
        remembered.append(change.reshape(-1))
        at += k * n
    return jnp.concatenate([v, total, *remembered])


FEW = 16
"""Terms up to which a sum is written out."""


def times(A: Any, x: Any) -> Any:
    """A x over the last axis. Short sums are written out: jax compiles them together with what surrounds them, where
    a reduction costs a loop of its own."""
    if A.shape[-1] > FEW:
        return A @ x
    return sum((A[..., j] * x[j] for j in range(A.shape[-1])), jnp.zeros(A.shape[:-1]))


_rate, _slope = jax.jit(rate), jax.jit(jax.jacfwd(rate, argnums=1))


def state_matrix(s: Sliding, z: Array) -> Array:
    """(n, n) derivative of z' over z."""
    return np.asarray(_slope(s, z))


EXACT = 1e-12
"""Last step to an equilibrium, over displacements and what the loads alone would move."""


def equilibrium(s: Sliding, z: Array | None = None) -> Array:
    """(n,) where nothing moves, with what drives it at its mean: Newton's method from z, or from rest.

    Raises:
        NotConverged: there is none that it finds.
    """
    mean, m = s._replace(cosine=0 * s.cosine, sine=0 * s.sine), len(s.push)
    z = np.zeros(s.order) if z is None else np.array(z, dtype=float)
    z[m : 2 * m] = 0.0
    free = np.r_[0:m, 2 * m : s.order]
    push = np.concatenate([s.push, np.zeros(s.order - 2 * m)])
    for _ in range(50):
        sides = np.stack([-np.asarray(_rate(mean, z))[m:], push], axis=1)
        change, alone = np.linalg.lstsq(state_matrix(mean, z)[m:, free], sides, rcond=1e-14)[0].T
        z[free] += change
        if np.abs(change).max(initial=0.0) <= EXACT * max(np.abs(z).max(initial=0.0), np.abs(alone).max(initial=0.0)):
            return z
        if not np.isfinite(z).all():
            break
    raise NotConverged("sliding: no equilibrium is found near the start; give another start, or larger dampers")


REMEMBERS = "sliding: contacts that remember have more than a stiffness and a damping; take state_matrix"


def linearised(s: Sliding, z: Array) -> tuple[Array, Array]:
    """(m, m) C and K with the tangents of contacts at an equilibrium, neither symmetric; M = 1.

    Raises:
        UserError: contacts that remember: take `state_matrix`.
    """
    if s.order != 2 * len(s.push):
        raise UserError(REMEMBERS)
    A, m = state_matrix(s, z), len(s.push)
    return -A[m:, m:], -A[m:, :m]


class Tangent(NamedTuple):
    """A contact at an equilibrium: (k, k) damping C and stiffness K along its coordinates, neither symmetric; (n, 3) N
    that its points take, and (n, 3) m/s with which they slide."""

    C: Array
    K: Array
    force: Array
    velocity: Array


def tangents(assembly: Assembly, s: Sliding, z: Array) -> list[Tangent]:
    """What the contacts of an assembly are at an equilibrium z of its equations s, one by one.

    Raises:
        UserError: contacts that remember.
    """
    if s.order != 2 * len(s.push):
        raise UserError(REMEMBERS)
    assembly = assembly.unrolled()
    moved = np.real(assembly.joined(0).rows) @ np.asarray(s.shapes) @ z[: len(s.push)]
    found, begin = [], 0
    for c in assembly.contacts:
        G, n, ground = c.patch.kinematics, len(c.patch.points), _ground(c)
        u = G @ (c.offset + moved[begin : begin + c.patch.count])
        begin += c.patch.count

        def force(u: Any, v: Any, law: Any = c.patch.law, n: int = n) -> Any:
            return law.rates(u, v, jnp.zeros((0, n)), 0.0, 0.0)[0]

        at = jax.device_put(u), jax.device_put(-ground)
        still = jnp.zeros_like(at[0])
        ways = [still.at[:, j].set(1.0) for j in range(3)]
        stiff = np.stack([np.asarray(jax.jvp(force, at, (way, still))[1]) for way in ways], axis=2)
        viscous = np.stack([np.asarray(jax.jvp(force, at, (still, way))[1]) for way in ways], axis=2)
        C, K = (np.einsum("nia,nij,njb->ab", G, A, G) for A in (viscous, stiff))
        found.append(Tangent(C, K, np.asarray(force(*at)), -ground))
    return found
