"""Set-valued contacts: the forces that a step asks of them, by Newton's method on their projections.

A point's motion over the step answers its forces linearly, w = w_0 - A f, all points together. With any r > 0,

    f_N = max(f_N + r w_N, 0),   f_T = the part of f_T + r w_T within mu f_N

says the same as: no gap and pressure, or a gap and none; stick within the cone, or slip along the force (P. Alart,
A. Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991). Two kinds of bodies give w:

- Bodies that yield at once by R (massless boundary; C. D. Monjaraz-Tec, J. Gross, M. Krack, Comput. Struct. 260, 2022):
  w_N is where the point is, w_T how far it came, A = R. An impact needs no law, and energy is kept.
- Masses (R = 0): the forces of this step move the next one. w is that next motion of a point whose gap is closed, and
  w_N more by e times the last one: restitution (after L. Paoli, M. Schatzman, SIAM J. Numer. Anal.
  40, 2002). An impact is found in the step after it, behind what is rigid; what rests there comes
  out within about a period, so slowly that the speed of it falls with the step.

On ground that moves, w is the motion over it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..contact.law import norm, ratio

PROJECTIONS = 3
"""Tried first: one will do for a single point."""

NEWTON = (3.0, 25), (1.0, 30), (0.3, 40)
"""r over the stiffness that a point meets by itself, and steps of Newton's method with it, one after the other. Of 200
steps of four corners of a rigid patch on six modes, most of them sticking, it ends with the first in 94 %, with one of
the three in 99 %; after 17 and 20 steps."""

CAREFUL = 3000
"""Projections with a step so short that they cannot diverge where Newton's method does not end."""

EXACT, ENOUGH = 1e-12, 1e-9
"""Share of the largest force to which they are found, and to which they need be: points whose answers differ by many
orders leave no more to rounding."""


class Meets(NamedTuple):
    """Points that answer. A: (3 p, 3 p) m/N. r: (p, 3) N/m, that each meets by itself. slow: share of r that always
    ends. back: share by which masses come out again in a step from where an impact found them."""

    A: Any
    r: Any
    slow: Any
    back: Any


def meets(A: Any, back: Any = 0.0) -> Meets:
    """A: (3 p, 3 p) m/N, symmetric and not negative, but for rounding. back: see `Meets`."""
    diagonal = jnp.diag(A).reshape(-1, 3)
    across = jnp.maximum(diagonal[:, 1], diagonal[:, 2])
    r = ratio(jnp.ones_like(diagonal), jnp.stack([diagonal[:, 0], across, across], axis=1))
    root = jnp.sqrt(r.reshape(-1))
    largest = jnp.linalg.eigvalsh(root[:, None] * A * root).max(initial=1.0)
    return Meets(A, r, 1 / largest, jnp.asarray(back))


def over_waves(M: Meets, slope: Any, lean: Any) -> Meets:
    """Of points over waves, whose way along the normal is w_N + slope . w_T, and whose force pushes by f_N lean; slope
    and lean (p, 2) are the same where what the ground takes it gives."""
    identity = jnp.broadcast_to(jnp.eye(3), (len(slope), 3, 3))
    way, force = identity.at[:, 0, 1:].set(slope), identity.at[:, 0, 1:].set(lean)
    A = M.A.reshape(len(slope), 3, len(slope), 3)

    def turned(left: Any, right: Any) -> Any:
        return jnp.einsum("pij,pjqk,qlk->piql", left, A, right).reshape(M.A.shape)

    return meets(turned(way, way))._replace(A=turned(way, force))


def within(x: Any, pressed: Any, mu: Any) -> Any:
    """(p, 3) the projection of x: (p, 3); pressed: (p,) N of points that others press, nan of those that press."""
    presses = jnp.isnan(pressed)
    normal = jnp.where(presses, jnp.maximum(x[:, 0], 0.0), jnp.where(presses, 0.0, pressed))
    limit, size = mu * normal, norm(x[:, 1:].T)
    kept = jnp.where(size > limit, ratio(limit, size), 1.0)
    return jnp.concatenate([normal[:, None], kept[:, None] * x[:, 1:]], axis=1)


class InclusionStep(NamedTuple):
    """What a step asks of points. M, mu, pressed: see `solve`. reach: (p, 3) m, w_0, and 0 of points that do not meet.
    meet: (p, 3), 1 of those that do."""

    M: Meets
    reach: Any
    meet: Any
    mu: Any
    pressed: Any

    def motion(self, f: Any) -> Any:
        """w, (p, 3) m."""
        return self.reach - (self.M.A @ f.reshape(-1)).reshape(f.shape)

    def aimed(self, f: Any, share: Any) -> tuple[Any, Any]:
        """f + r w, (p, 3) N, and coefficients of friction (p,). share: of `Meets.r` that is r."""
        w = self.motion(f)
        return f + share * self.M.r * w, self.mu(norm(w[:, 1:].T))

    def projected(self, f: Any, share: Any = 1.0) -> Any:
        """(p, 3) N."""
        x, coefficient = self.aimed(f, share)
        return self.meet * within(x, self.pressed, coefficient)

    def residual(self, f: Any) -> Any:
        """(p, 3) N."""
        return self.meet * (f - self.projected(f))

    def newton(self, f: Any, share: Any) -> Any:
        """(p, 3) N, a step of Newton's method further."""
        M, n = self.M, f.size
        x, coefficient = self.aimed(f, share)
        P = jax.vmap(jax.jacfwd(lambda a, p, c: within(a[None], p[None], c[None])[0]))(x, self.pressed, coefficient)
        turned = jnp.eye(n) - share * M.r.reshape(-1)[:, None] * M.A
        P = jnp.einsum("pij,pjk->pik", self.meet[:, :, None] * P, turned.reshape(*f.shape, -1))
        J = jnp.eye(n) - P.reshape(n, -1)
        missed = self.meet * (f - self.meet * within(x, self.pressed, coefficient))
        way = jnp.linalg.solve(J + 1e-12 * jnp.eye(n), missed.reshape(-1))
        return f - way.reshape(f.shape)

    def off(self, f: Any, r: Any) -> Any:
        """Share of the largest force that is missed, by a residual."""
        return jnp.abs(r).max() / jnp.maximum(jnp.abs(f).max(), jnp.abs(self.M.r * self.reach).max())

    def found(self, f: Any) -> Any:
        """(p, 3) N: one way after the other from where the one before left it, if that is not enough. A loop for all
        of them: each way stands once in the program."""
        shares = jnp.stack([jnp.ones(()), *(jnp.asarray(share) for share, _ in NEWTON), self.M.slow])
        most = jnp.asarray([PROJECTIONS, *(steps for _, steps in NEWTON), CAREFUL])

        def wanted(carried: tuple) -> Any:
            return carried[0] < len(most)

        def further(carried: tuple) -> tuple:
            way, i, f, r = carried
            curved, share = (way > 0) & (way <= len(NEWTON)), shares[way]
            f = jax.lax.cond(curved, self.newton, self.projected, f, share)
            finite = jnp.isfinite(f).all()
            f = jnp.where(finite, f, 0.0)
            r = self.residual(f)
            off = self.off(f, r)
            ended = ~finite | ~(off > EXACT) | (i + 1 >= most[way])
            after = jnp.where(finite & ~(off > ENOUGH), len(most), way + 1)
            return jnp.where(ended, after, way), jnp.where(ended, 0, i + 1), f, r

        f = jnp.where(jnp.isfinite(f).all(), f, 0.0)
        r = self.residual(f)
        begin = jnp.where(self.off(f, r) > EXACT, 0, len(most))
        return jax.lax.while_loop(wanted, further, (begin, jnp.zeros((), int), f, r))[2]


def solve(M: Meets, w_0: Any, mu: Any, pressed: Any, first: Any) -> tuple[Any, Any, Any]:
    """Forces (p, 3) N, motions w (p, 3) m, and the largest residual as a motion, m.

    Args:
        w_0: (p, 3) m of the points without forces; of points that do not meet, -inf along the normal. mu: function of
            the sliding way (p,). pressed: see `within`. first: (p, 3) N to begin with.
    """
    meets = jnp.isfinite(w_0[:, :1]) * jnp.ones(3)
    asked = InclusionStep(M, jnp.where(jnp.isfinite(w_0), w_0, 0.0), meets, mu, pressed)
    f = asked.found(meets * first)
    return f, asked.motion(f), jnp.abs(ratio(asked.residual(f), M.r)).max(initial=0.0)
