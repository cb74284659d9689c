"""The strips of `strips` with a friction characteristic: each element a `contact.point.PointContact` at its speed of
sliding (Sextro, 6.5 with 3.6 and 3.7). A hundred times the work of constant friction."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..contact.friction import Friction
from ..contact.law import program, settings
from ..contact.normal import Preload
from ..contact.point import PointContact
from .kalker import Coefficients
from .strips import Array, Distribution, Forces, Poses, Spin, Tractions, broadcast, grid, over_elements, posed


@settings
class Warmed(Friction):
    """A characteristic of which heat has left a share at each point."""

    cold: Friction
    left: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return self.left * self.cold.coefficient(speed, pressed, time)

    def highest(self, pressed: Array, time: Array | float = 0.0) -> Array:
        return self.left * self.cold.highest(pressed, time)


@partial(program, static_argnames=("elements", "distribution"))
def _marched(
    pose: Poses, friction: Friction, speed: Array, left: Array, elements: tuple[int, int], distribution: Distribution
) -> tuple[Forces, tuple[Array, ...]]:  # fmt: skip
    """left: (nx, ny n) share of the friction, from the leading edge on. Forces, and what `over_elements` takes."""
    g = grid(elements, distribution)
    ny, n = len(g.y), len(pose.a)
    flat = lambda v: jnp.broadcast_to(v, (ny, n)).ravel()  # noqa: E731
    chord, width = g.chord[:, None], g.width[:, None]
    reach, across = flat(pose.a * chord), flat(pose.b * g.y[:, None])
    length, area = 2 * reach / len(g.x), flat(2 * pose.a * chord / len(g.x) * pose.b * width)
    pressed = flat(pose.normal_force / (pose.a * pose.b * g.pressed) * chord ** g.powers[0]) * area
    by = chord ** g.powers[1] / (pose.a * g.sprung)
    springs = [flat(c * by) * area for c in (pose.stiffness_x, pose.stiffness_y)]
    along = flat(pose.xi) - flat(pose.phi_x) * across

    def step(carry: Any, element: Any) -> tuple[Any, tuple[Array, ...]]:
        state, before, sum_ = carry
        x, way, p, share, changed, warm = element
        x, h = reach * x, length * way
        law = PointContact(Preload(pressed * p), Warmed(friction, warm), springs[0] * share, springs[1] * share)
        state = state._replace(elastic=state.elastic * changed)
        moved = h * jnp.stack([along, flat(pose.eta) + flat(pose.phi_y) * (x + 0.5 * h)])
        u = jnp.concatenate([jnp.zeros_like(h)[None], state.tangential + moved]).T
        found, after = law.step(u, u / h[:, None], h / flat(speed), state)
        t, slid = -found.T[1:], after.slipped - state.slipped
        work = -0.5 * jnp.sum((before + t) * slid, axis=0) / length
        slides = jnp.sum(slid**2, axis=0) > 1e-18 * jnp.sum(moved**2, axis=0)
        added = t[0], t[1], x * t[1] - across * t[0], work, jnp.where(slides, area, 0.0)
        shown = x, pressed * p / area, *t / area, *t / (jnp.stack(springs) * share)
        return (after, t, Forces(*(s + a for s, a in zip(sum_, added, strict=True)))), shown

    one = PointContact(Preload(pressed), friction, springs[0], springs[1]).init(ny * n)
    none = jnp.zeros(ny * n)
    changed = np.concatenate([[1.0], g.stiffness[1:] / g.stiffness[:-1]])
    per_element = tuple(map(jnp.asarray, (g.x, g.way, g.pressure, g.stiffness, changed, left)))
    start = one, jnp.stack([none, none]), Forces(*[none] * 5)
    (_, t, sum_), found = jax.lax.scan(step, start, per_element)
    h = 0.5 * length  # to the trailing edge, as in `strips.forces`
    rigid = along, flat(pose.eta) - flat(pose.phi_y) * (reach - 0.5 * h)
    work = sum(f * (f / (k * g.stiffness[-1]) - h * s) for f, k, s in zip(t, springs, rigid, strict=True))
    sum_ = sum_._replace(power=sum_.power + 0.5 * work / length)
    x, y, moment, power, slides = (v.reshape(ny, n).sum(axis=0) for v in sum_)
    fields = (jnp.moveaxis(v.reshape(-1, ny, n), 1, 0) for v in found)
    slides = slides / (2 * pose.a * pose.b * float(g.chord @ g.width))
    return Forces(x, y, moment, power, slides), (*fields, length.reshape(ny, n))


def rolled_by_characteristic(
    *given: ArrayLike, friction: Friction, speed: ArrayLike, left: Array | None = None,
    elements: tuple[int, int] = (20, 20), distribution: Distribution = "constant", **how: Any,
) -> tuple[Forces, Tractions]:  # fmt: skip
    """Forces and tractions, see `forces_by_characteristic`.

    Args:
        given: xi, eta, phi, a, b, normal_force, shear, poisson. left: (n, ny, nx) share of the friction that heat has
            left, all of it if not given.
    """
    *state, V = broadcast(*given, speed)
    highest = np.full_like(V, np.max(friction.highest(jnp.ones(1))))
    of = (*state[:6], highest, *state[6:])
    pose = posed(*of, elements=elements, distribution=distribution, **how)  # type: ignore[misc]
    nx, ny = elements
    share = jnp.ones((len(V), ny, nx)) if left is None else left[..., ::-1]
    share = jnp.transpose(share, (2, 1, 0)).reshape(nx, -1)
    forces, fields = _marched(pose, friction, V, share, elements=elements, distribution=distribution)
    over = over_elements(Poses(*map(np.asarray, pose)), grid(elements, distribution), *fields)
    return Forces(*map(np.asarray, forces)), over


def forces_by_characteristic(
    xi: ArrayLike, eta: ArrayLike, phi: ArrayLike, a: ArrayLike, b: ArrayLike, normal_force: ArrayLike,
    friction: Friction, speed: ArrayLike, shear: ArrayLike, poisson: ArrayLike, *,
    elements: tuple[int, int] = (20, 20), distribution: Distribution = "constant",
    coefficients: Coefficients = "table", spin: Spin = "kalker",
) -> Forces:  # fmt: skip
    """`strips.creep_forces` with a coefficient over the speed of sliding.

    Args:
        friction: a characteristic of `contact.friction`. speed: of rolling, m/s. The rest as there.
    """
    given = xi, eta, phi, a, b, normal_force, shear, poisson
    how: dict[str, Any] = {"coefficients": coefficients, "spin": spin}
    return rolled_by_characteristic(
        *given, friction=friction, speed=speed, elements=elements, distribution=distribution, **how
    )[0]
