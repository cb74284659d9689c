"""The strips of `strips` with a friction characteristic: each element a `contact.point.PointContact` at its speed of
sliding (Sextro, 6.5 with 3.6 and 3.7). A hundred times the work of constant friction. States of rolling with any
friction and the heat they make; friction and temperature converged together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
from ..interrupts import look
from ..programs import program
from ..settings.arguments import checked
from .arguments import Poissons, Positives, Reals, Resolution, joined
from .kalker import Coefficients
from .strips import (
    BLOCK,
    NAMES,
    Array,
    CreepForces,
    Distribution,
    Poses,
    Spin,
    StripGrid,
    Tractions,
    creep_forces,
    grid,
    over_elements,
    posed,
    tractions,
)
from .temperature import Conductor, conducted, falling, heat_share, settled
from .wheelset import Drag, RollingPatch, Track, states


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
    smooth_n, depths = smooth.reshape(-1, ny, n), 1 - jnp.asarray(g.x)[:, None, None] ** 2
    rough = jnp.zeros_like(smooth_n), jnp.zeros_like(smooth_n)  # springs, N/m, and how deep elements sink, m
    if surface is not None:
        rough = sunk(surface, smooth_n, depth * g.chord[:, None] ** 2 * depths)

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


# heat ----------------------------------------------------------------------------------------------------------------

COLD = 20.0
"""degrees C at which a characteristic of friction holds."""


@dataclass(frozen=True)
class Heat:
    """Where the heat of friction goes.

    Attributes: bodies: wheel and rail, over which the contact moves equally fast. start: their temperatures, degrees C.
        limit: dT_E (6.7-23), rise above `COLD` at which friction would be gone, K; None: friction does not change.
    """

    bodies: tuple[Conductor, Conductor]
    start: tuple[float, float]
    limit: float | None = None

    def temperature(self, source: Array, dx: Array, speed: Array) -> Array:
        """Of both surfaces, degrees C: without friction they meet at the mean of their starts, weighted by what each
        conducts, and the friction heats both equally (6.7-11, 6.7-15).

        Args:
            source: (n, ny, nx) W/m^2. dx: (n, ny) lengths of elements, m. speed: (n,) m/s.
        """
        share = heat_share(*self.bodies, 1.0, 1.0)
        scaled = source * np.sqrt(dx / speed[:, None])[..., None]  # of a surface all goes with sqrt(dx/V)
        rise = conducted(scaled.reshape(-1, source.shape[-1]).T, 1.0, self.bodies[0], share, 1.0)
        return share * self.start[0] + (1 - share) * self.start[1] + rise.T.reshape(source.shape)


@dataclass(frozen=True)
class States:
    """Of n states. Attributes: forces: (n,). hottest: (n,) largest temperature, degrees C, if asked. tractions: of
    those that are kept."""

    forces: CreepForces
    hottest: Array | None
    tractions: Tractions


def sources(t: Tractions, speed: Array) -> tuple[Array, Array]:
    """(n, ny, nx) heat of friction per area, W/m^2, and (n, ny) lengths of elements, m, at speeds (n,) m/s."""
    return t.power * speed[:, None, None], t.x[..., 1] - t.x[..., 0]


def rolled(
    given: Array, friction: Friction, speed: Array, kept: Array, heat: Heat | None = None,
    surface: RoughSurface | None = None, **how: Any,
) -> States:  # fmt: skip
    """Forces, heat and some of the tractions.

    Args:
        given: (8, n) xi, eta, phi, a, b, normal_force, shear, poisson, as `strips.creep_forces`. speed: (n,) of
            rolling, m/s. kept: (k,) indices of states whose tractions are wanted. surface: of rough bodies. how: as
            `strips.creep_forces`.

    Raises:
        UserError: friction and temperature do not settle.
    """
    if friction.constant and heat is None and surface is None:
        of = _with_constant(given, friction)
        return States(creep_forces(*of, **how), None, tractions(*(v[kept] for v in of), **how))
    blocks = [np.arange(i, min(i + BLOCK, len(speed))) for i in range(0, len(speed), BLOCK)]
    parts, hottest, some = [], [], []
    for block in blocks:
        look()
        f, t = _rolled(given[:, block], friction, speed[block], heat, surface, how)
        parts.append(f)
        some.append([v[np.isin(block, kept)] for v in t])
        if heat is not None:
            hottest.append(heat.temperature(*sources(t, speed[block]), speed[block]).max(axis=(1, 2)))
    forces = CreepForces(*map(np.concatenate, zip(*parts, strict=True)))
    held = Tractions(*map(np.concatenate, zip(*some, strict=True)))
    return States(forces, np.concatenate(hottest) if hottest else None, held)


def drag(track: Track, friction: Friction, heat: Heat | None, surface: RoughSurface | None, **how: Any) -> Drag:
    """Of patches, as `rolled` has it, for the vertical balance of `wheelset.patches`."""
    warm = heat if heat is not None and heat.limit is not None else None

    def across(found: list[RollingPatch]) -> Array:
        given, speed = states(track, found)
        if friction.constant and warm is None and surface is None:
            return creep_forces(*_with_constant(given, friction), **how).y
        return _rolled(given, friction, speed, warm, surface, how)[0].y

    return across


def _with_constant(given: Array, friction: Friction) -> list[Array]:
    mu = np.broadcast_to(np.asarray(friction.highest(jnp.ones(1))), given.shape[1:])
    return [*given[:6], mu, *given[6:]]


def _rolled(
    given: Array, friction: Friction, speed: Array, heat: Heat | None, surface: RoughSurface | None, how: dict[str, Any]
) -> tuple[CreepForces, Tractions]:  # fmt: skip
    warm = heat is not None and heat.limit is not None
    if friction.constant and not warm and surface is None:
        of = _with_constant(given, friction)
        return creep_forces(*of, **how), tractions(*of, **how)

    def march(left: Array | None = None) -> tuple[CreepForces, Tractions]:
        return rolled_by_characteristic(*given, friction=friction, speed=speed, left=left, surface=surface, **how)

    if not warm:
        return march()
    assert heat is not None and heat.limit is not None
    dx = sources(march()[1], speed)[1]
    left, _ = settled(
        lambda left: sources(march(left)[1], speed)[0],
        lambda q: heat.temperature(q, dx, speed),
        lambda T: falling(T - COLD, 1.0, heat.limit),  # type: ignore[arg-type]
        np.ones((len(speed), *how["elements"][::-1])),
    )
    return march(left)
