"""A contact patch of point contacts: kinematics, equilibrium under given forces, tangent of the sticking contact.

Both bodies move as rigid ones over a rigid patch (Sextro Eq. (5.2-2)), so six coordinates u_O = [u_n, u_t1, u_t2,
phi_n, phi_t1, phi_t2] carry all of its points. A patch that deforms has coordinates of its own, given by what one of
them moves the points by. Forces and derivatives are found point by point and contracted with the kinematics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array, Indices
from ..errors import NotConverged, UserError
from ..programs import seldom
from .law import Law, point_axes, stepped
from .portion import portion


@dataclass(frozen=True)
class Patch:
    """Point contacts of one interface, whose frame (n, t1, t2) is the contact's.

    Attributes:
        interface: name. points: (n, 2) places along t1 and t2 from the patch's origin, m. areas: (n,) m2.
        law: contact law of the points, its extensive numbers those of one point.
        shapes: (n, 3, k) displacement along n, t1, t2 per unit of k coordinates of a patch that deforms, the first six
            of them those of a rigid one; None: rigid.
    """

    interface: str
    points: Array
    areas: Array
    law: Law
    shapes: Array | None = None

    @property
    def count(self) -> int:
        """Number of its coordinates, six of a rigid patch."""
        return 6 if self.shapes is None else self.shapes.shape[2]

    @property
    def kinematics(self) -> Array:
        """(n, 3, k) displacement of every point per unit of the coordinates (Sextro Eq. (5.2-4) of a rigid patch).

        u_M = u_O + phi x r with r = (0, y, z): y along t1, z along t2.
        """
        if self.shapes is not None:
            return self.shapes
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


def equilibrium(
    patch: Patch, normal: float, moments: tuple[float, float] = (0.0, 0.0), compliance: Array | None = None
) -> Array:  # fmt: skip
    """(k,) coordinates at which the patch carries a normal force (N) and moments about t1 and t2 (N m).

    Sextro Eq. (5.2-5) in physical units, friction left out (the factor 1/(n_y n_z) that is missing there is in the
    numbers of the law, those of one point). Newton's method from an approach that presses harder than asked.

    Args:
        compliance: (k, k) of the bodies along the coordinates, m/N: a patch that deforms yields to its own pressure,
            e = -C f in all coordinates beyond the first six; None: it keeps its shape.

    Raises:
        UserError: a normal force that is negative, or that the law reaches at no approach; a law without a value.
        NotConverged: moments that tilt the patch off the neighbour.
    """
    if normal < 0:
        raise UserError(f"normal force: {normal:g} N; a contact cannot pull, give 0 or more")
    asked, u = np.array([normal, *moments]), np.zeros(patch.count)
    if np.allclose(_pressed(patch, u)[0][_TILTS], asked, rtol=1e-12, atol=0.0) or normal == 0:
        return u
    u[0] = depth = _deep_enough(patch, normal)
    half = np.append(1.0, np.maximum(np.abs(patch.points).max(axis=0)[::-1], 1e-3))  # rims that phi_t1, phi_t2 lift
    C = np.zeros((0, patch.count)) if compliance is None else np.asarray(compliance)[6:]

    def missing(u: Array) -> tuple[Array, Array]:
        force, K = _pressed(patch, u)
        e, slope = _yielding(u, force, K, C)
        return np.append((force[_TILTS] - asked) / (half * normal), e / depth), np.vstack(
            [K[_TILTS] / (half * normal)[:, None], slope / depth]
        )

    free = np.array([*_TILTS, *range(6, 6 + len(C))])
    unit = np.append(1 / half, np.ones(len(C))) * depth
    found = _newton(missing, u, free, unit)
    if found is None:
        turned = f" and moments of {moments[0]:g} and {moments[1]:g} N m" if any(moments) else ""
        raise NotConverged(f"{patch.interface}: no equilibrium under {normal:g} N{turned} was found{_hint(patch)}")
    return found


def pressed_by(patch: Patch, interference: float, compliance: Array | None = None) -> Array:
    """(k,) coordinates of a patch whose bodies overlap by an interference (m; negative: a gap) where they stay as made.

    Rigid bodies keep it; elastic ones give way: u = a - C f in the normal coordinate, the tilts and the deformations,
    friction left out.

    Args:
        compliance: (k, k) of the bodies along the coordinates, m/N; None: rigid.

    Raises:
        NotConverged: Newton's method found no state.
    """
    u = np.zeros(patch.count)
    u[0] = interference
    if compliance is None or interference <= 0:
        return u
    free = np.array([*_TILTS, *range(6, patch.count)])
    C, far = np.asarray(compliance)[free], u.copy()

    def missing(u: Array) -> tuple[Array, Array]:
        force, K = _pressed(patch, u)
        slope = np.eye(patch.count)[free] + C @ K
        return (u[free] - far[free] + C @ force) / interference, slope / interference

    found = _newton(missing, u, free, np.full(len(free), interference))
    if found is None:
        words = f"{patch.interface}: no state under an interference of {interference:g} m was found"
        raise NotConverged(words + _hint(patch))
    return found


def pressure(patch: Patch, u: Array) -> Array:
    """(n,) contact pressure of the points (Pa) at coordinates (k,), friction left out."""
    return np.asarray(_normal(patch.law, patch.kinematics[:, 0] @ u)[0]) / patch.areas


def pressing(patch: Patch, u: Array) -> Array:
    """(k,) forces along the coordinates by the normal pressure at (k,) coordinates, N and N m."""
    return _pressed(patch, u)[0]


def _hint(patch: Patch) -> str:
    """What to do where no state is found: few points open one by one, and leave no pressure between them."""
    n = len(patch.points)
    if patch.shapes is not None:
        return f"; its points are the {n} of the mesh: refine the face, or take a rigid patch"
    return f" with {n} point{'s' if n > 1 else ''}; raise points"


_TILTS = [0, 4, 5]
"""Of the six rigid coordinates those that press: u_n, phi_t1, phi_t2."""


def _yielding(u: Array, force: Array, K: Array, C: Array) -> tuple[Array, Array]:
    """e + C f (m - 6,) of deformations that yield, and its derivative (m - 6, k); C: their rows of the compliance."""
    if not len(C):
        return np.zeros(0), np.zeros((0, len(u)))
    return u[6:] + C @ force, np.eye(len(u))[6:] + C @ K


def _newton(
    missing: Callable[[Array], tuple[Array, Array]], u: Array, free: Indices, unit: Array
) -> Array | None:  # fmt: skip
    """Root of `missing` over some of the coordinates, in units; None if a hundred steps do not find it."""
    for _ in range(100):
        off, slope = missing(u)
        if np.abs(off).max() <= 1e-12:
            return u
        step = np.zeros_like(u)
        step[free] = np.linalg.lstsq(slope[:, free] * unit, -off, rcond=1e-13)[0] * unit
        u = u + step * _kept(missing, u, step, float(np.linalg.norm(off)))
    return None


def _kept(missing: Callable[[Array], tuple[Array, Array]], u: Array, step: Array, before: float) -> float:
    """The longest of 1, 1/2, 1/4, ... of a Newton step that brings the state nearer to what is asked for."""
    for share in 0.5 ** np.arange(12):
        if np.linalg.norm(missing(u + share * step)[0]) < before:
            return float(share)
    return float(share)


def _deep_enough(patch: Patch, normal: float) -> float:
    """A pure approach (m) whose force is not below the one asked for."""
    u = np.zeros(patch.count)
    for u[0] in 1e-9 * 2.0 ** np.arange(40):
        if _pressed(patch, u)[0][0] >= normal:
            return float(u[0])
    raise UserError(
        f"{patch.interface}: no approach below {u[0]:.2g} m makes a normal force of {normal:g} N; press it less, or "
        "make it stiffer"
    )


def _pressed(patch: Patch, u: Array) -> tuple[Array, Array]:
    """(k,) forces of the normal pressure at (k,) coordinates, and (k, k) their derivative."""
    G = patch.kinematics[:, 0]
    force, slope = (_known(patch, part) for part in _normal(patch.law, G @ u))
    return G.T @ force, G.T @ (slope[:, None] * G)


def _known(patch: Patch, values: jax.Array) -> Array:
    """Forces or derivatives by the law of a patch.

    Raises:
        UserError: the law has none.
    """
    if np.isnan(found := np.asarray(values)).any():
        law = type(patch.law).__name__
        raise UserError(f"{patch.interface}: its law, {law}, pressed by itself gives what is not a number; correct it")
    return found


@seldom
def _normal(law: Law, approach: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jax.jvp(law.pressed, (approach,), (jnp.ones_like(approach),))


def stuck_stiffness(patch: Patch, u: Array) -> Array:
    """(k, k) tangent of the patch about (k,) coordinates, every point sticking (Sextro Eq. (5.2-32), linear); about
    (d, k) several of them.

    Raises:
        UserError: a law without one.
    """
    G = patch.kinematics
    at = np.einsum("nia,da->dni", G, np.atleast_2d(u))
    slopes = np.einsum("nia,dnij,njb->dab", G, _known(patch, _tangents(patch.law, at)), G)
    return slopes.reshape(*u.shape, -1)


@seldom
def _tangents(law: Law, places: jax.Array) -> jax.Array:
    """(d, n, 3, 3) derivatives of the force for small motions from loaded states (d, n, 3) without tangential force."""

    def tangent(u: jax.Array) -> jax.Array:
        at_rest = u.at[:, 1:].set(0.0)
        state = stepped(law, at_rest, jnp.zeros_like(u), 1.0, law.init(len(u)))[1]

        def moved(direction: jax.Array) -> jax.Array:
            whole = jnp.broadcast_to(direction, u.shape)
            return jax.jvp(lambda x: stepped(law, x, jnp.zeros_like(x), 1.0, state)[0], (at_rest,), (whole,))[1]

        return jnp.moveaxis(jax.vmap(moved)(jnp.eye(3)), 0, 2)

    return jax.vmap(tangent)(places)


# few points for many, where derivatives need not be exact -------------------------------------------------------------
# The points of a patch that few coordinates move share their motion, so that few of them tell how the resultants follow
# it: of 360 points of a rough contact that slides, 28 give Newton's steps within some thousandths.

FEW = 24
"""Points that are enough, about."""

UNLIKE = 3.0
"""Times the mean that a point may stand for."""


@dataclass(frozen=True, eq=False)
class Thinned:
    """Some points of a patch. chosen: (m,) which; share: (m,) how many points each of them stands for."""

    chosen: Indices
    share: Array

    def law(self, law: Law, n: int) -> Law:
        """A law of n points for the few."""
        leaves, tree = jax.tree_util.tree_flatten(law)

        def few(leaf: Any, axis: int | None) -> Any:
            return leaf if axis is None else jnp.take(jnp.asarray(leaf), self.chosen, axis=axis)

        each = [few(x, axis) for x, axis in zip(leaves, point_axes(law, n), strict=True)]
        return portion(jax.tree_util.tree_unflatten(tree, each), jnp.asarray(self.share))

    def patch(self, patch: Patch) -> Patch:
        """A patch by its few points."""
        shapes = None if patch.shapes is None else patch.shapes[self.chosen]
        points, areas = patch.points[self.chosen], patch.areas[self.chosen] * self.share
        return replace(patch, points=points, areas=areas, law=self.law(patch.law, len(patch.points)), shapes=shapes)


def thinned(patch: Patch) -> Thinned | None:
    """About `FEW` points of a patch, as stiff as all of them where all are equal; None where they cannot be.

    Every p-th one, p a prime that the count is no multiple of, lest all stand in one row of a grid. Shares are the
    nearest to equal ones for which the sums of G_n^T G_n and G_t^T G_t over the points are those of all of them.
    """
    G, n = patch.kinematics, len(patch.points)
    steps = [p for p in range(2, n // FEW + 1) if n % p and all(p % q for q in range(2, p))]
    if not steps or G.shape[2] ** 2 > FEW * 2:
        return None
    chosen = np.arange(0, n, steps[-1])
    both = np.concatenate([np.einsum("nia,nib->nab", g, g).reshape(n, -1) for g in (G[:, :1], G[:, 1:])], axis=1)
    both = both[:, used] / np.abs(both[:, used]).max(axis=0) if (used := both.any(axis=0)).any() else both[:, used]
    whole, few, even = both.sum(axis=0), both[chosen].T, np.full(len(chosen), n / len(chosen))
    share = even + np.linalg.lstsq(few, whole - few @ even, rcond=1e-10)[0]
    kept = np.allclose(few @ share, whole, rtol=0.0, atol=1e-9 * n)
    return Thinned(chosen, share) if kept and (np.abs(np.log(share / even)) < np.log(UNLIKE)).all() else None
