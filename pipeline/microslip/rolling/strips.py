"""Creep forces by strips: point contacts marched from the leading edge, each with its springs and its slider.

Sextro, 6.3 to 6.5. The upper body is 1; x along rolling, the material enters at x = +a. Rigid slip of body 1 relative
to 2, over the speed: s_M = (xi - phi y, eta + phi x) (6.3-8). The springs between both stretch by u' = s_M - s_P
(6.3-4); the traction on body 1 is their stiffness times u, cut where friction holds no more. The return map of
`contact.point` does that, so that a point that slid sticks again where the spin turns its slip.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..contact.point import opposed
from ..interrupts import look
from ..programs import program
from ..settings.arguments import checked
from .arguments import Frictions, Poissons, Positives, Reals, Resolution, joined
from .kalker import Coefficients, coefficients_at

Array = Any
"""Of numpy; of jax in what is traced."""

Distribution = Literal["constant", "non-constant"]
Spin = Literal["kalker", "book"]

BLOCK = 256
"""Poses that are marched side by side: what they remember stays in the nearest cache."""

TINY = 1e-300
"""Keeps quotients of nothing finite."""

RUN = 8
"""Blocks that a call marches one after the other, where there are so many: calls cost a fifth of the time."""


class Poses(NamedTuple):
    """n states of rolling, arrays (n,) that broadcast.

    Attributes: xi, eta: creepages. phi_x, phi_y: spin, 1/m, as the springs along and across feel it (`poses`). a, b:
        half axes along and across rolling, m. normal_force: N. friction: coefficient. stiffness_x, stiffness_y: C11 G
        and C22 G, Pa.
    """

    xi: Array
    eta: Array
    phi_x: Array
    phi_y: Array
    a: Array
    b: Array
    normal_force: Array
    friction: Array
    stiffness_x: Array
    stiffness_y: Array


class CreepForces(NamedTuple):
    """On body 1 at the middle of the patch, arrays (n,).

    Attributes: x, y: N. moment: about z, N m. power: of friction over the speed, N; the heat. sliding: share of the
        area that slips.
    """

    x: Array
    y: Array
    moment: Array
    power: Array
    sliding: Array


class Tractions(NamedTuple):
    """Over the elements, (..., ny, nx), x and y ascending.

    Attributes: x, y: middles, m. area: m2. pressure, traction_x, traction_y: on body 1, Pa. slip_x, slip_y: of body 1
        relative to 2 over the speed, s_P. power: of friction over the speed, Pa, whose integral is that of
        `CreepForces`.
    """

    x: Array
    y: Array
    area: Array
    pressure: Array
    traction_x: Array
    traction_y: Array
    slip_x: Array
    slip_y: Array
    power: Array

    def __repr__(self) -> str:
        return f"<Tractions over {' x '.join(map(str, self.pressure.shape))} elements>"


@dataclass(frozen=True)
class StripGrid:
    """Strips and their elements, without unit; the elements begin at the leading edge.

    Attributes:
        y, width: (ny,) of the strips over b, at Gauss' points, so that what does not slip is integrated exactly.
        chord: (ny,) x_A/a (6.4-28). x: (nx,) middles over x_A. way: (nx,) from middle to middle over the length of an
            element; the first begins at the edge. pressure, stiffness: (nx,) means over the element of what (6.4-29),
            (6.4-33) and (6.4-39), (6.4-42) distribute, of stiffness weighted by 1 - x. powers: of the chord by which
            both grow from strip to strip.
            pressed, sprung, spun: sums that make the force F_N and, without slip, C G a b s (6.4-25) and C23 G c^3 phi.
    """

    y: np.ndarray
    width: np.ndarray
    chord: np.ndarray
    x: np.ndarray
    way: np.ndarray
    pressure: np.ndarray
    stiffness: np.ndarray
    powers: tuple[int, int]
    pressed: float
    sprung: float
    spun: float


@cache
def grid(elements: tuple[int, int], distribution: Distribution) -> StripGrid:
    """elements: (nx, ny) along and across rolling."""
    nx, ny = elements
    y, width = np.polynomial.legendre.leggauss(ny)
    chord = np.sqrt(1 - y**2)
    edge = 1 - 2 * np.arange(nx + 1) / nx
    x, way = 0.5 * (edge[1:] + edge[:-1]), np.where(np.arange(nx), 1.0, 0.5)

    def mean(of: np.ndarray) -> np.ndarray:
        return 0.5 * nx * -np.diff(of)

    if distribution == "constant":
        pressure, stiffness, powers = mean(edge - edge**3 / 3), np.ones(nx), (2, 0)
    else:
        angle = np.arcsin(edge)
        # infinite at the edges: the mean of what stick makes of it, u growing evenly from the leading edge on
        stiffness = mean(angle + np.sqrt(1 - edge**2)) / (1 - x)
        pressure, powers = mean(0.5 * (angle + edge * np.sqrt(1 - edge**2))), (1, -1)
    pressed = np.sum(chord ** (powers[0] + 1) * width) * np.sum(pressure) * 2 / nx
    sprung = np.sum(chord ** (powers[1] + 2) * width) * np.sum(stiffness * (1 - x)) * 2 / nx
    spun = np.sum(chord ** (powers[1] + 3) * width) * np.sum(stiffness * (1 - x**2)) * 2 / nx
    return StripGrid(y, width, chord, x, way, pressure, stiffness, powers, float(pressed), float(sprung), float(spun))


Pair = tuple[Array, ...]


def _strip(pose: Poses, g: StripGrid, y: Array, chord: Array) -> tuple[Any, Array]:
    """What a strip is marched by, from the stretch u of an element to the next one, and the length of an element."""
    reach, across, nx = pose.a * chord, pose.b * y, len(g.x)
    length = 2 * reach / nx
    along = pose.xi - pose.phi_x * across
    pressure = pose.normal_force / (pose.a * pose.b * g.pressed) * chord ** g.powers[0]
    by = chord ** g.powers[1] / (pose.a * g.sprung)
    springs = pose.stiffness_x * by, pose.stiffness_y * by
    stiffer = jnp.maximum(*springs)
    relative = springs[0] / stiffer, springs[1] / stiffer

    def step(u: Pair, element: Pair) -> tuple[Pair, Pair, Pair, tuple[Array, ...]]:
        x, way, pressed, share = element
        x, h, p, k = reach * x, length * way, pressure * pressed, (springs[0] * share, springs[1] * share)
        far = u[0] - h * along, u[1] - h * (pose.eta + pose.phi_y * (x + 0.5 * h))
        left, slides = opposed((k[0] * far[0], k[1] * far[1]), relative, pose.friction * p)
        u = left[0] * far[0], left[1] * far[1]
        return u, (k[0] * u[0], k[1] * u[1]), (far[0] - u[0], far[1] - u[1]), (x, p, slides)

    return step, length


def _elements(g: StripGrid) -> tuple[Array, ...]:
    return tuple(map(jnp.asarray, (g.x, g.way, g.pressure, g.stiffness)))


def forces(pose: Poses, elements: tuple[int, int] = (20, 20), distribution: Distribution = "constant") -> CreepForces:
    """Forces of poses whose arrays are all (n,): pure, for `jax.jit`, `vmap` and `grad`; see `creep_forces`."""
    g = grid(elements, distribution)
    none = jnp.zeros_like(pose.a)

    def strip(total: CreepForces, of: tuple[Array, ...]) -> tuple[CreepForces, None]:
        y, chord, width = of
        step, length = _strip(pose, g, y, chord)

        def element(carry: tuple[Pair, Pair, CreepForces], one: Any) -> tuple[tuple[Pair, Pair, CreepForces], None]:
            u, before, sum_ = carry
            u, t, slid, (x, _, slides) = step(u, one)
            work = 0.5 * ((before[0] + t[0]) * slid[0] + (before[1] + t[1]) * slid[1])
            added = (t[0], t[1], x * t[1] - pose.b * y * t[0], work, slides)
            return (u, t, CreepForces(*(s + a for s, a in zip(sum_, added, strict=True)))), None

        start = (none, none), (none, none), CreepForces(*[none] * 5)
        (u, t, sum_), _ = jax.lax.scan(element, start, _elements(g))
        h = 0.5 * length  # to the trailing edge, where nothing is left of u
        rigid = pose.xi - pose.phi_x * pose.b * y, pose.eta - pose.phi_y * (pose.a * chord - 0.5 * h)
        left = u[0] - h * rigid[0], u[1] - h * rigid[1]
        power = sum_.power + 0.5 * (t[0] * left[0] + t[1] * left[1])
        across = pose.b * width
        area = length * across
        slid = sum_.sliding * area / (2 * pose.a * pose.b * float(g.chord @ g.width))
        added = *(f * area for f in sum_[:3]), power * across, slid
        return CreepForces(*(s + f for s, f in zip(total, added, strict=True))), None

    return jax.lax.scan(strip, CreepForces(*[none] * 5), tuple(map(jnp.asarray, (g.y, g.chord, g.width))))[0]


@partial(program, static_argnums=(1, 2))
def _marched(pose: Poses, elements: tuple[int, int], distribution: Distribution) -> tuple[Array, ...]:
    """x, pressure, both tractions and both stretches, (ny, nx, n), from the leading edge on; lengths (ny, n)."""
    g = grid(elements, distribution)
    none = jnp.zeros_like(pose.a)

    def strip(of: Any) -> tuple[Array, ...]:
        step, length = _strip(pose, g, *of)

        def element(u: Pair, one: Any) -> tuple[Pair, tuple[Array, ...]]:
            u, t, _, (x, p, _) = step(u, one)
            return u, (x, p, *t, *u)

        return *jax.lax.scan(element, (none, none), _elements(g))[1], length

    return jax.lax.map(strip, (jnp.asarray(g.y), jnp.asarray(g.chord)))


def blended(L: Array, creep: Array, a: Array, b: Array, held: Array) -> Array:
    """Kalker's flexibilities (3, ...), nearer to a single one the larger the creepage is.

    The rule of CONTACT, whose outputs the validation compares with: w = min(1, |creepage| / 3 of what would be held
    without slip), and each L_i becomes (1 - w) L_i + w of their mean weighted by the creepages.

    Args:
        L: of xi, eta and phi, m3/N. creep: (3, ...) xi, eta, phi. held: mu F_N, N.
    """
    of_force = 8 * a**2 * b / 3  # c^2 G C_ii L_i
    limit = jnp.maximum(held, TINY) / of_force * jnp.sqrt(L[0] ** 2 + L[1] ** 2)
    w = jnp.minimum(1.0, jnp.sqrt(creep[0] ** 2 + creep[1] ** 2 + TINY) / limit / 3)
    square = jnp.stack([creep[0], creep[1], creep[2] * (3 * jnp.pi / 32) * a]) ** 2
    mean = (jnp.sum(square, axis=0) + TINY) / (jnp.sum(square / L, axis=0) + TINY / L[0])
    return (1 - w) * L + w * mean


SLIPPERY = 1e-12
"""What stands for no friction: the march divides by what is held."""


def poses(
    xi: Array, eta: Array, phi: Array, a: Array, b: Array, normal_force: Array, friction: Array, shear: Array,
    poisson: Array, *, elements: tuple[int, int] = (20, 20), distribution: Distribution = "constant",
    coefficients: Coefficients = "table", spin: Spin = "kalker",
) -> Poses:  # fmt: skip
    """What `forces` takes, from what `creep_forces` takes, arrays (n,): as pure."""
    friction = jnp.maximum(friction, SLIPPERY)
    G, g = coefficients_at(a / b, poisson, coefficients)[:3] * shear, grid(elements, distribution)
    if spin == "book":
        return Poses(xi, eta, phi, phi, a, b, normal_force, friction, G[0], G[1])
    turned = 2 * jnp.sqrt(b / a) * G[2] * g.sprung / g.spun  # stiffness against the spin, of the form of G[0] and G[1]
    L = blended(8 * a / 3 / jnp.stack([G[0], G[1], turned]), jnp.stack([xi, eta, phi]), a, b, friction * normal_force)
    x, y, turned = 8 * a / 3 / L
    return Poses(xi, eta, phi * turned / x, phi * turned / y, a, b, normal_force, friction, x, y)


posed = program(poses, static_argnames=("elements", "distribution", "coefficients", "spin"))
"""`poses`, compiled."""


@partial(program, static_argnames=("elements", "distribution", "coefficients", "spin"))
def _rolled(*given: Array, elements: tuple[int, int], distribution: Distribution, **how: Any) -> CreepForces:
    """Of (blocks, n) arrays."""

    def block(of: tuple[Array, ...]) -> CreepForces:
        pose = poses(*of, elements=elements, distribution=distribution, **how)
        return forces(pose, elements, distribution)

    return jax.lax.map(block, given)


def runs(n: int, block: int) -> Iterator[slice]:
    """Of blocks: `RUN` at a time, then one by one, so that two shapes are compiled at the most."""
    blocks = -(-n // block)
    many = blocks - blocks % RUN
    for i in range(0, many, RUN):
        look()
        yield slice(i, i + RUN)
    for i in range(many, blocks):
        look()
        yield slice(i, i + 1)


@checked
def creep_forces(
    xi: Reals, eta: Reals, phi: Reals, a: Positives, b: Positives, normal_force: Positives,
    friction: Frictions, shear: Positives, poisson: Poissons, *, elements: Resolution = (20, 20),
    distribution: Distribution = "constant", coefficients: Coefficients = "table", spin: Spin = "kalker",
) -> CreepForces:  # fmt: skip
    """Forces on body 1 of any number of states of rolling, by the strip model of Sextro, 6.5.

    Args:
        xi, eta: creepages. phi: spin, 1/m. a, b: half axes along and across rolling, m. normal_force: N. friction:
            coefficient. shear, poisson: G (Pa) and nu of both bodies combined (`ellipse.combined`). All are arrays that
            broadcast. elements: along and across rolling. distribution: of stiffness and pressure over a strip,
            (6.4-29) to (6.4-38) or (6.4-39) to (6.4-46). coefficients: Kalker's table, or the book's polynomials.
            spin: "kalker" has a third flexibility of C23, and `blended` ones; "book" the springs of C11 and C22 alone.

    Returns:
        Arrays (n,), N and N m.

    Raises:
        UserError: a value or a word that no state of rolling has.
    """
    given = states(xi, eta, phi, a, b, normal_force, friction, shear, poisson)
    n = len(given[0])
    filled = [np.concatenate([v, np.repeat(v[-1:], -n % BLOCK)]).reshape(-1, BLOCK) for v in given]
    how = {"elements": tuple(elements), "distribution": distribution, "coefficients": coefficients, "spin": spin}
    parts = [_rolled(*(v[run] for v in filled), **how) for run in runs(n, BLOCK)]
    return CreepForces(*(np.concatenate([np.asarray(p[k]).ravel() for p in parts])[:n] for k in range(5)))


NAMES = "xi", "eta", "phi", "a", "b", "normal_force", "friction", "shear", "poisson"


def states(*given: ArrayLike) -> list[Array]:
    """Arrays (n,) of what `creep_forces` takes; see `arguments.joined`."""
    return [v.ravel() for v in joined(**dict(zip(NAMES, given, strict=True)))]


@checked
def tractions(
    xi: Reals, eta: Reals, phi: Reals, a: Positives, b: Positives, normal_force: Positives,
    friction: Frictions, shear: Positives, poisson: Poissons, *, elements: Resolution = (20, 20),
    distribution: Distribution = "constant", coefficients: Coefficients = "table", spin: Spin = "kalker",
) -> Tractions:  # fmt: skip
    """Pressure, tractions and slip over the elements, of the states that `creep_forces` takes: arrays (n, ny, nx).

    The slip is s_M - u' with the slope of u through the neighbours, so that friction takes as much power as the
    creepages give (errata to (6.5-16)).
    """
    elements, given = tuple(elements), states(xi, eta, phi, a, b, normal_force, friction, shear, poisson)
    how = {"coefficients": coefficients, "spin": spin}
    pose = Poses(*map(np.asarray, posed(*given, elements=elements, distribution=distribution, **how)))  # type: ignore
    return over_elements(pose, grid(elements, distribution), *_marched(pose, elements, distribution))


def over_elements(pose: Poses, g: StripGrid, *marched: Array) -> Tractions:
    """marched: x, pressure, both tractions and both stretches, (ny, nx, n), from the leading edge on; length of an
    element (ny, n)."""
    *found, length = map(np.asarray, marched)
    x, p, t_x, t_y, u_x, u_y = (np.moveaxis(v, -1, 0)[..., ::-1] for v in found)
    length = length.T[..., None]
    y = np.broadcast_to((pose.b[:, None] * g.y)[..., None], x.shape)
    xi, eta, phi_x, phi_y = (v[:, None, None] for v in pose[:4])
    rigid = xi - phi_x * y, eta + phi_y * x
    slip = [r - _slope(u) / length for r, u in zip(rigid, (u_x, u_y), strict=True)]
    area = np.broadcast_to(length * (pose.b[:, None] * g.width)[..., None], x.shape)
    at = np.concatenate([x[..., :1] - 0.5 * length, x, x[..., -1:] + 0.5 * length], axis=-1)
    h = np.diff(at)
    rigid = xi - phi_x * y[..., :1], eta + phi_y * (at[..., 1:] - 0.5 * h)
    work = sum(_work(t, u, h * s) for t, u, s in zip((t_x, t_y), (u_x, u_y), rigid, strict=True))
    return Tractions(x, y, area, p, t_x, t_y, slip[0], slip[1], work / length)


def _work(t: np.ndarray, u: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Per element, half of that of the steps to and from it, and all of what is done at the edges."""
    slid = np.diff(_ended(u)) - moved
    work = 0.5 * (_ended(t)[..., 1:] + _ended(t)[..., :-1]) * slid
    work[..., [0, -1]] *= 2
    return 0.5 * (work[..., 1:] + work[..., :-1])


def _ended(v: np.ndarray) -> np.ndarray:
    """With the edges, half an element away, where nothing is left."""
    return np.pad(v, [(0, 0)] * (v.ndim - 1) + [(1, 1)])


def _slope(u: np.ndarray) -> np.ndarray:
    """Per element, x ascending."""
    ends = _ended(u)
    slope = 0.5 * (ends[..., 2:] - ends[..., :-2])
    slope[..., 0], slope[..., -1] = 0.5 * (u[..., 0] + u[..., 1]), -0.5 * (u[..., -1] + u[..., -2])
    return slope
