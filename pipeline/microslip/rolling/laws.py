"""The strips of `strips` with a friction characteristic: each element a `contact.point.PointContact` at its speed of
sliding (Sextro, 6.5 with 3.6 and 3.7). A hundred times the work of constant friction."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..contact.friction import Friction
from ..contact.heights import Heights
from ..contact.hertz import ellipse_integrals
from ..contact.law import settings
from ..contact.normal import Normal, Preload, Rough
from ..contact.point import PointContact
from ..programs import program
from ..settings.arguments import checked
from .arguments import Poissons, Positives, Reals, Resolution, joined
from .kalker import Coefficients
from .strips import (
    NAMES,
    Array,
    CreepForces,
    Distribution,
    Poses,
    Spin,
    StripGrid,
    Tractions,
    grid,
    over_elements,
    posed,
)


@settings
class Warmed(Friction):
    """A characteristic of which heat has left a share at each point."""

    cold: Friction
    left: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return self.left * self.cold.coefficient(speed, pressed, time)

    def highest(self, pressed: Array, time: Array | float = 0.0) -> Array:
        return self.left * self.cold.highest(pressed, time)


class RoughSurface(NamedTuple):
    """Of both bodies together. Attributes: heights. roughness: R_Z, m."""

    heights: Heights
    roughness: Array


def approach(a: Array, b: Array, force: Array, modulus: Array) -> Array:
    """Of Hertz' bodies with these half axes (m) under a force (N), m; modulus: E*, Pa."""
    K = ellipse_integrals(np.minimum(a, b) / np.maximum(a, b))[0]
    return 3 * force * K / (2 * np.pi * modulus * np.maximum(a, b))


def sunk(surface: RoughSurface, smooth: Array, depth: Array) -> tuple[Array, Array]:
    """Springs, and how deep elements are pressed in, so that rough ones carry together what smooth ones did (3.3-21).

    Args:
        smooth: (nx, ny, n) N that smooth elements carry. depth: likewise, m, of them. All of a state sink deeper by one
            factor, found by Newton's method from above: the force is convex.

    Returns:
        N/m and m.
    """
    heights, R = surface
    springs, goal = smooth / depth, smooth.sum(axis=(0, 1))

    def nearer(_: int, more: Array) -> Array:
        u = more * depth / R
        force, slope = springs * R * heights.volume(u), smooth * heights.area(u)
        return more - (force.sum(axis=(0, 1)) - goal) / slope.sum(axis=(0, 1))

    above = 1 + R * springs.sum(axis=(0, 1)) / goal
    return springs, jax.lax.fori_loop(0, NEWTON, nearer, above) * depth


NEWTON = 40
"""Steps; a quarter of them is enough where peaks are finite."""


class Elements(NamedTuple):
    """Of the strips of n states, arrays (ny n,); nx elements each.

    Attributes:
        reach, across: half the chord, and y, m. along: creepage of the strip. length: of an element, m. area: m^2.
        pressed: N that an element carries over its share. springs: N/m, likewise, along and across rolling.
    """

    reach: Array
    across: Array
    along: Array
    length: Array
    area: Array
    pressed: Array
    springs: tuple[Array, Array]


def _elements(pose: Poses, g: StripGrid, flat: Callable[[Array], Array]) -> Elements:
    chord, width = g.chord[:, None], g.width[:, None]
    reach, across = flat(pose.a * chord), flat(pose.b * g.y[:, None])
    length, area = 2 * reach / len(g.x), flat(2 * pose.a * chord / len(g.x) * pose.b * width)
    pressed = flat(pose.normal_force / (pose.a * pose.b * g.pressed) * chord ** g.powers[0]) * area
    by = chord ** g.powers[1] / (pose.a * g.sprung)
    springs = flat(pose.stiffness_x * by) * area, flat(pose.stiffness_y * by) * area
    return Elements(reach, across, flat(pose.xi) - flat(pose.phi_x) * across, length, area, pressed, springs)


@partial(program, static_argnames=("elements", "distribution"))
def _marched(
    pose: Poses, friction: Friction, speed: Array, left: Array, surface: RoughSurface | None, depth: Array,
    elements: tuple[int, int], distribution: Distribution,
) -> tuple[CreepForces, tuple[Array, ...]]:  # fmt: skip
    """left: (nx, ny n) share of the friction, from the leading edge on. depth: (n,) approach of smooth bodies, m.
    Forces, and what `over_elements` takes."""
    g = grid(elements, distribution)
    ny, n = len(g.y), len(pose.a)
    flat = lambda v: jnp.broadcast_to(v, (ny, n)).ravel()  # noqa: E731
    e = _elements(pose, g, flat)
    smooth = jnp.asarray(g.pressure)[:, None] * e.pressed
    rough = _roughened(surface, depth, g, smooth.reshape(-1, ny, n))

    def normal(p: Array, spring: Array) -> Normal:
        return Preload(p) if surface is None else Rough(spring, surface.roughness, surface.heights)

    def step(carry: Any, element: Any) -> tuple[Any, tuple[Array, ...]]:
        state, before, sum_ = carry
        x, way, p, share, changed, warm, spring, sink = element
        x, h = e.reach * x, e.length * way
        law = PointContact(normal(p, spring), Warmed(friction, warm), e.springs[0] * share, e.springs[1] * share)
        state = state._replace(elastic=state.elastic * changed)
        moved = h * jnp.stack([e.along, flat(pose.eta) + flat(pose.phi_y) * (x + 0.5 * h)])
        u = jnp.concatenate([sink[None], state.tangential + moved]).T
        found, after = law.step(u, u / h[:, None], h / flat(speed), state)
        t, slid = -found.T[1:], after.slipped - state.slipped
        work = -0.5 * jnp.sum((before + t) * slid, axis=0) / e.length
        slides = jnp.sum(slid**2, axis=0) > 1e-18 * jnp.sum(moved**2, axis=0)
        added = t[0], t[1], x * t[1] - e.across * t[0], work, jnp.where(slides, e.area, 0.0)
        shown = x, found.T[0] / e.area, *t / e.area, *(after.slipped - after.tangential)
        return (after, t, CreepForces(*(s + a for s, a in zip(sum_, added, strict=True)))), shown

    one = PointContact(normal(e.pressed, e.pressed), friction, *e.springs).init(ny * n)
    none = jnp.zeros(ny * n)
    changed = np.concatenate([[1.0], g.stiffness[1:] / g.stiffness[:-1]])
    pressed = (smooth, g.stiffness, changed, left, *(v.reshape(smooth.shape) for v in rough))
    per_element = tuple(map(jnp.asarray, (g.x, g.way, *pressed)))
    start = one, jnp.stack([none, none]), CreepForces(*[none] * 5)
    (last, t, sum_), found = jax.lax.scan(step, start, per_element)
    h = 0.5 * e.length  # to the trailing edge, as in `strips.forces`
    rigid = e.along, flat(pose.eta) - flat(pose.phi_y) * (e.reach - 0.5 * h)
    work = sum(f * (u - h * s) for f, u, s in zip(t, last.slipped - last.tangential, rigid, strict=True))
    sum_ = sum_._replace(power=sum_.power + 0.5 * work / e.length)
    forces = CreepForces(*(v.reshape(ny, n).sum(axis=0) for v in sum_))
    fields = (jnp.moveaxis(v.reshape(-1, ny, n), 1, 0) for v in found)
    share = forces.sliding / (2 * pose.a * pose.b * float(g.chord @ g.width))
    return forces._replace(sliding=share), (*fields, e.length.reshape(ny, n))


def _roughened(surface: RoughSurface | None, depth: Array, g: StripGrid, smooth: Array) -> tuple[Array, Array]:
    """(nx, ny, n) normal springs of rough elements, N/m, and how deep they sink, m, under the forces of smooth ones."""
    if surface is None:
        return jnp.zeros_like(smooth), jnp.zeros_like(smooth)
    return sunk(surface, smooth, depth * g.chord[:, None] ** 2 * (1 - jnp.asarray(g.x)[:, None, None] ** 2))


def rolled_by_characteristic(
    *given: ArrayLike,
    friction: Friction,
    speed: ArrayLike,
    left: Array | None = None,
    surface: RoughSurface | None = None,
    elements: tuple[int, int] = (20, 20),
    distribution: Distribution = "constant",
    **how: Any,
) -> tuple[CreepForces, Tractions]:
    """Forces and tractions, see `forces_by_characteristic`.

    Args:
        given: xi, eta, phi, a, b, normal_force, shear, poisson. left: (n, ny, nx) share of the friction that heat has
            left, all of it if not given. surface: rough elements carry the same force together, by the share of their
            area that touches, deeper pressed in; the ellipse stays.
    """
    named = dict(zip(NAMES[:6] + NAMES[7:], given, strict=True))
    *state, V = (v.ravel() for v in joined(**named, speed=speed))
    highest = np.full_like(V, np.max(friction.highest(jnp.ones(1))))
    of = (*state[:6], highest, *state[6:])
    pose = posed(*of, elements=elements, distribution=distribution, **how)  # type: ignore[misc]
    nx, ny = elements
    share = jnp.ones((len(V), ny, nx)) if left is None else left[..., ::-1]
    share = jnp.transpose(share, (2, 1, 0)).reshape(nx, -1)
    depth = approach(state[3], state[4], state[5], state[6] / (1 - state[7]))
    forces, fields = _marched(pose, friction, V, share, surface, depth, elements=elements, distribution=distribution)
    over = over_elements(Poses(*map(np.asarray, pose)), grid(elements, distribution), *fields)
    return CreepForces(*map(np.asarray, forces)), over


@checked
def forces_by_characteristic(
    xi: Reals, eta: Reals, phi: Reals, a: Positives, b: Positives, normal_force: Positives,
    friction: Friction, speed: Positives, shear: Positives, poisson: Poissons, *,
    elements: Resolution = (20, 20), distribution: Distribution = "constant",
    coefficients: Coefficients = "table", spin: Spin = "kalker", surface: RoughSurface | None = None,
) -> CreepForces:  # fmt: skip
    """`strips.creep_forces` with a coefficient over the speed of sliding, and rough surfaces.

    Args:
        friction: a characteristic of `contact.friction`. speed: of rolling, m/s. surface: `RoughSurface` of both
            bodies' heights and R_Z. The rest as there.

    Raises:
        UserError: see there; friction that is no characteristic.
    """
    given = xi, eta, phi, a, b, normal_force, shear, poisson
    how: dict[str, Any] = {"coefficients": coefficients, "spin": spin, "surface": surface}
    return rolled_by_characteristic(
        *given, friction=friction, speed=speed, elements=tuple(elements), distribution=distribution, **how
    )[0]
