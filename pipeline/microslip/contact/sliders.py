"""Microslip as a law: sliders in parallel, each with its own spring, its own limit and its own memory.

Some of the sliders slide while others stick, so that the tangential force bends gradually from stick to slip, and a
cycle of any size dissipates. `Strips` are the parts of a rough surface or of a round contact, which touch one after
the other; `Iwan` sliders share one normal force and differ in strength.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ..errors import UserError
from ..reduced.compliance import BULK_AND_SURFACE
from ..settings.numbers import NotNegative, Number
from .friction import Coulomb, OfCoulomb
from .heights import Heights, as_table
from .kinds import LawKind
from .law import Array, Law, Scalar, Step, norm, number, ratio, settings, static, value, values
from .normal import Normal, Preload
from .partial_slip import NormalContact
from .point import PointContact, Stretch, dragged, let_go, met, slide, touching, weight
from .series import BULK
from .solids import refuse_not_positive
from .stiffness import OfHertz

if TYPE_CHECKING:
    from .composed import ContactModel
    from .settings import ContactLaw


class SliderState(NamedTuple):
    """State of m sliders at n points: u_t (2, n) m, elastic forces (m, 2, n) N, their limits (m, n) N, springs (m, n)
    N/m, slip (2, n) m."""

    tangential: Array
    elastic: Array
    limits: Array
    springs: Array
    slipped: Array


class Sliders(Law):
    """Base: m sliders in parallel at every point, each a Coulomb cone behind a spring.

    As in `point.PointContact` a spring that grows takes no force with it and one that shrinks loses its part, which
    gives no energy; a slider whose limit falls while it sticks slides.
    """

    mu: Array
    stiffness_ratio: Array | None
    viscous: ClassVar[bool] = False

    def count(self) -> int:
        """Number of sliders."""
        raise NotImplementedError

    def local(self, approach: Array) -> tuple[Array, Array, Array]:
        """Normal force (n,) N, springs along t1 (m, n) N/m and limits (m, n) N at an approach (n,) m."""
        raise NotImplementedError

    def full(self) -> Array:
        """(m, 1) or (m, n) springs along t1 with all of the area in contact, N/m."""
        raise NotImplementedError

    def touching(self, approach: Array) -> Array:
        """The springs of contacts that barely touch, see `point.touching`; all of them where it is one by one."""
        return self.full()

    def init(self, n: int) -> SliderState:
        pair, each = jnp.zeros((2, n)), jnp.zeros((self.count(), n))
        return SliderState(pair, jnp.zeros((self.count(), 2, n)), each, each + self.full(), pair)

    def step(self, u: Array, v: Array, dt: Scalar, state: SliderState) -> tuple[Array, SliderState]:
        pressed, springs, limits = self.local(u.T[0])
        left, relaxed, both = self._met(u.T[0], springs, state)
        way = both * (u.T[1:] - state.tangential)
        if self.stiffness_ratio is None:
            elastic = _each(dragged(*map(_each, (relaxed, way)), state.limits * left, limits))
        else:
            elastic = _held_of_two(relaxed + way, both, limits)
        slipped = state.slipped + ratio(jnp.sum(relaxed + way - elastic, axis=0), jnp.sum(both, axis=0))
        force = jnp.concatenate([pressed[None], jnp.sum(elastic, axis=0)])
        return force.T, SliderState(u.T[1:], elastic, limits, springs, slipped)

    def way(self, u: Array, v: Array, dt: Scalar, state: SliderState) -> Any:
        if self.stiffness_ratio is not None:
            return super().way(u, v, dt, state)
        pressed, springs, limits = self.local(u.T[0])
        left, _, both = self._met(u.T[0], springs, state)
        way = both * (u.T[1:] - state.tangential)
        return Stretch(pressed, springs, both, both, left, _each(way), state.limits * left, limits)

    def drag(self, way: Any, memory: Array) -> tuple[Array, Array]:
        if self.stiffness_ratio is not None:
            return super().drag(way, memory)
        elastic = dragged(_each(memory) * way.left, way.way, way.before, way.held)
        return jnp.concatenate([way.pressed[None], jnp.sum(elastic, axis=1)]), _each(elastic)

    def memory(self, force: Array, state: SliderState) -> Array:
        return state.elastic

    def recalled(self, state: SliderState, memory: Array) -> SliderState:
        return state._replace(elastic=memory)

    def limit(self, force: Array, state: SliderState) -> Array:
        return self.mu * force[:, 0]

    def slip(self, state: SliderState) -> Array:
        return state.slipped.T

    def stored(self, u: Array, state: SliderState) -> Array:
        stretched = ratio(state.elastic**2, self._both(state.springs))
        return self.pressed_energy(u[:, 0]) + 0.5 * jnp.sum(stretched, axis=(0, 1))

    def lost(self, step: Step) -> Array:
        before, after = step.before, step.after
        _, relaxed, both = self._met(step.u[:, 0], after.springs, before)
        slid = jnp.moveaxis(step.moved.T[1:] - ratio(after.elastic - relaxed, both), 1, 0)
        rubbed = 0.5 * (before.limits + after.limits) * norm(slid)
        stretch = (jnp.moveaxis(ratio(one.elastic, self._both(one.springs)), 1, 0) for one in (before, after))
        changed = jnp.moveaxis(self._both(jnp.abs(after.springs - before.springs)), 1, 0)
        return jnp.sum(rubbed + let_go(changed, *stretch), axis=0)

    def _met(self, approach: Array, springs: Array, state: SliderState) -> tuple[Array, Array, Array]:
        """Of springs (m, n) N/m at the end of a step: (m, n) share of each that was there before, (m, 2, n) N what it
        carried then, (m, 2, n) N/m what the springs count over the step."""
        left = jnp.minimum(ratio(springs, state.springs), 1.0)
        both = self._both(met(springs, jnp.maximum(state.springs, self.touching(approach))))
        return left, state.elastic * left[:, None], both

    def pressed_energy(self, approach: Array) -> Array:
        """(n,) energy of the normal springs, J."""
        raise NotImplementedError

    def _both(self, springs: Array) -> Array:
        """(m, 2, n) springs along t1 and t2, N/m; (m, 1, n) if they are the same."""
        if self.stiffness_ratio is None:
            return springs[:, None]
        return jnp.stack([springs, springs * self.stiffness_ratio], axis=1)


def _each(forces: Array) -> Array:
    """(2, m, n) from (m, 2, n), and the other way round."""
    return jnp.swapaxes(forces, 0, 1)


def _held_of_two(trial: Array, stiffness: Array, limits: Array) -> Array:
    """(m, 2, n) what friction holds of the trial forces behind unequal springs (m, 2, n): it opposes the slip
    (`point.weight`)."""
    forces, springs = (_each(part).reshape(2, -1) for part in (trial, stiffness))
    relative, flat = ratio(springs, jnp.max(springs, axis=0), 1.0), limits.reshape(-1)
    theta = slide(forces, springs, relative, Coulomb(jnp.ones(())), flat, 1.0, jnp.zeros(()))
    kept = (forces * weight(theta, relative)).reshape(2, *limits.shape)
    return _each(kept)


@settings
class Strips(Sliders):
    """Strips of one contact that touch one after the other (Sextro Eqs. (5.2-33), (3.3-15), (3.3-16)).

    Strip i begins to touch at the approach depth x_i. It then carries the normal force w_i c_N0 (u_n - depth x_i) and
    friction up to mu times that, behind the spring w_i c_R0. At first loading this is 3.8-26 of the normal law that
    the strips stand for, which is piecewise linear. `rough_strips`, `mindlin` make them.

    Attributes:
        at: (m, 1) or (m, n) x_i, rising. shares: the same shape, w_i, whose sum is 1. depth: of x = 1, m; the roughness
            R_Z of a rough surface. stiffness_0: c_N0 of all strips, N/m. stiffness_t: c_R0 of all strips along t1,
            N/m.
        held: approach, m, that no motion changes, for a constant normal force (`under`); None: that of u.
        stiffness_ratio: tangential stiffness along t2 over that along t1; None: 1. includes: whose compliance the
            stiffnesses count, one of `series.INCLUDES`.
    """

    at: Array = number()
    shares: Array = number(ge=0)
    depth: Array = number(gt=0)
    stiffness_0: Array = number(ge=0)
    stiffness_t: Array = number(ge=0)
    mu: Array = number(ge=0)
    held: Array | None = number(default=None)
    stiffness_ratio: Array | None = number(gt=0, default=None)
    includes: str = static(default=BULK_AND_SURFACE)

    def count(self) -> int:
        return jnp.shape(self.at)[0]

    def local(self, approach: Array) -> tuple[Array, Array, Array]:
        overlap = self._overlap(approach)
        pressed = self.stiffness_0 * self.shares * overlap
        springs = jnp.where(overlap > 0, self.stiffness_t * self.shares, 0.0)
        return jnp.sum(pressed, axis=0), springs, self.mu * pressed

    def full(self) -> Array:
        return self.stiffness_t * self.shares

    def pressed_energy(self, approach: Array) -> Array:
        if self.held is not None:
            return self.local(approach)[0] * approach
        return 0.5 * self.stiffness_0 * jnp.sum(self.shares * self._overlap(approach) ** 2, axis=0)

    def approach(self, force: ArrayLike) -> np.ndarray:
        """Approach (m) under a normal force (N), any shape; strips the same for all points.

        Raises:
            UserError: settings per point, or a force that does not press.
        """
        loads = np.asarray(force, dtype=float)
        parts = [np.squeeze(np.asarray(p)) for p in (self.at, self.shares, self.depth, self.stiffness_0)]
        if parts[0].ndim > 1 or parts[2].ndim or parts[3].ndim:
            raise UserError("strips: settings differ from point to point; solve for the approach of each point apart")
        if not (loads > 0).all():
            raise UserError(f"normal force: {loads.min():g} N does not press the contact; give a positive one")
        gaps, stiffness = np.atleast_1d(parts[0]) * parts[2], np.cumsum(np.atleast_1d(parts[1])) * parts[3]
        knots = np.concatenate([[0.0], np.cumsum(stiffness[:-1] * np.diff(gaps))])
        i = np.searchsorted(knots, loads, side="right") - 1
        return gaps[i] + (loads - knots[i]) / stiffness[i]

    def under(self, force: ArrayLike) -> Strips:
        """The same contact under a constant normal force (N, one or one per point), whatever the normal motion."""
        return replace(self, held=jax.device_put(self.approach(force)))

    def _overlap(self, approach: Array) -> Array:
        """(m, n) how far each strip is pressed, m."""
        if self.held is not None:
            approach = jnp.broadcast_to(self.held, jnp.shape(approach))
        return jnp.maximum(approach - self.depth * self.at, 0.0)


@settings
class Iwan(Sliders):
    """Sliders under one normal force, in parallel: Iwan's parallel-series model (J. Appl. Mech. 33, 1966).

    Slider i has the share k_i of the stiffness and the share f_i of the limit mu F_N. The limits follow the normal
    force of the moment, the springs the share of the area (3.3-40) as in `point.PointContact`, of which this is the
    law with several sliders. `uniform` and `segalman` give the shares.

    Attributes:
        normal: normal law. mu: friction coefficient. stiffness: tangential stiffness of the full area along t1, N/m.
        shares: (m, 1) or (m, n) k_i, whose sum is 1. strengths: the same shape, f_i, whose sum is 1.
        stiffness_ratio: of t2 over t1; None: 1. includes: whose compliance the stiffnesses count, one of
            `series.INCLUDES`.
    """

    normal: Normal
    mu: Array = number(ge=0)
    stiffness: Array = number(ge=0)
    shares: Array = number(ge=0)
    strengths: Array = number(ge=0)
    stiffness_ratio: Array | None = number(gt=0, default=None)
    includes: str = static(default=BULK_AND_SURFACE)

    def count(self) -> int:
        return jnp.shape(self.shares)[0]

    def local(self, approach: Array) -> tuple[Array, Array, Array]:
        pressed = self.normal.force(approach)
        springs = self.stiffness * self.shares * self.normal.share(approach)
        return pressed, springs, self.mu * self.strengths * pressed

    def full(self) -> Array:
        return self.stiffness * self.shares

    def touching(self, approach: Array) -> Array:
        return self.full() * touching(self.normal, approach)

    def pressed_energy(self, approach: Array) -> Array:
        return self.normal.stored(approach)


def jenkins(stiffness: float, mu: float, normal: float | Normal) -> PointContact:
    """One slider behind one spring. normal: a normal law, or a constant force in N; stiffness: tangential, N/m."""
    law = normal if isinstance(normal, Normal) else Preload(value(normal))
    return PointContact(law, Coulomb(value(mu)), value(stiffness))


# Shares of Iwan's sliders ------------------------------------------------------------------------------------------


def uniform(count: int, weakest: float = 0.0) -> tuple[Array, Array]:
    """Shares and strengths (count, 1) of sliders of equal stiffness whose strengths are equally frequent.

    From 0 the force of first loading is the parabola k u (1 - k u / (4 mu F_N)), and slip is complete at
    u = 2 mu F_N / k.

    Args:
        weakest: strength of the weakest slider over that of the strongest, from 0 to below 1.

    Raises:
        UserError: no slider, or another weakest.
    """
    _counted(count)
    if not 0 <= weakest < 1:
        raise UserError(f"weakest: {weakest:g}; it must be 0 or more and below 1")
    edges = np.linspace(weakest, 1.0, count + 1)
    return _columns(np.full(count, 1.0), 0.5 * (edges[1:] + edges[:-1]))


def segalman(count: int, exponent: float, ratio_last: float, smallest: float = 1e-3) -> tuple[Array, Array]:
    """Shares and strengths (count, 1) of the distribution of D. J. Segalman (J. Appl. Mech. 72, 2005), 4 parameters.

    The density of the slip displacements is R phi^chi up to phi_max, where a last slider holds the share that is left
    over: the tangent falls there to zero from beta/(1 + beta) of the first. A cycle between +-A <= phi_max dissipates
    4 R A^(chi + 3) / ((chi + 2) (chi + 3)), R = k (chi + 1) / ((1 + beta) phi_max^(chi + 1)). The two other parameters
    are the stiffness k and mu F_N of `Iwan`: phi_max = (1 + beta) / (beta + (chi + 1)/(chi + 2)) mu F_N / k.

    The density is cut in geometric intervals; each slider has the stiffness and the strength of its interval, so that
    the force of first loading is exact at their ends and too large by the second order of their width between.

    Args:
        exponent: chi, above -1; measured joints lie between -1 and 0. ratio_last: beta, of the stiffness of the last
            slider to that of all others, 0 or more. smallest: end of the first interval over phi_max; cycles smaller
            than that dissipate nothing or too little.

    Raises:
        UserError: a parameter outside its bounds.
    """
    _counted(count)
    if not (exponent > -1 and ratio_last >= 0 and 0 < smallest < 1):
        raise UserError(
            f"Segalman's distribution: exponent {exponent:g}, ratio {ratio_last:g}, smallest {smallest:g}; "
            "they must lie above -1, at 0 or above, and between 0 and 1"
        )
    spread = count - 1 if ratio_last > 0 else count
    if spread < 1:
        raise UserError(f"sliders: {count}; Segalman's distribution with a last slider needs 2 or more")
    edges = np.concatenate([[0.0], np.geomspace(smallest, 1.0, spread) if spread > 1 else [1.0]])
    shares = np.diff(edges ** (exponent + 1))
    displacements = np.diff(edges ** (exponent + 2)) / shares * (exponent + 1) / (exponent + 2)
    if ratio_last > 0:
        shares, displacements = np.append(shares, ratio_last), np.append(displacements, 1.0)
    return _columns(shares, displacements)


def _columns(shares: np.ndarray, displacements: np.ndarray) -> tuple[Array, Array]:
    """Shares of the stiffness and of the strength from stiffnesses and the displacements at which sliders let go."""
    strengths = shares * displacements
    return tuple(jax.device_put((part / part.sum())[:, None]) for part in (shares, strengths))  # type: ignore[return-value]


def _counted(count: int) -> None:
    if count < 1:
        raise UserError(f"sliders: {count}; give 1 or more")


# Strips of contacts ------------------------------------------------------------------------------------------------


def rough_strips(
    stiffness_0: float, roughness: float, heights: Heights, stiffness_t: float, mu: float, count: int
) -> Strips:
    """The strips of a rough surface (`normal.Rough`), each at the mean of its heights.

    With the mean height the strips' normal force touches the smooth one at the limits of the heights and lies below
    it in between, by share times width over 8 (in c_N0 R_Z); beyond the deepest height it is exact. The strips are as
    wide as makes this the same for all: the error falls with the square of their number also where few heights lie.
    The error of (3.8-26) is at most mu times that.

    Args:
        stiffness_0: c_N0, N/m. roughness: R_Z, m. heights: from x* = 0 (`heights.Cut` makes others so).
        stiffness_t: c_R0, N/m. mu: friction coefficient. count: of strips.

    Raises:
        UserError: a setting that is not positive, heights that lie above x* = 0.
    """
    _counted(count)
    refuse_not_positive(stiffness_0=stiffness_0, roughness=roughness, stiffness_t=stiffness_t, friction=mu)
    table = as_table(heights)
    if table.x.ndim != 1:
        raise UserError("height distribution: one table per point; make the strips of each point apart")
    if float(table.x[0]) < 0:
        raise UserError("height distribution: begins below x = 0, where the contact is open; take Cut(...) of it")
    edges = _edges(np.asarray(table.x), np.asarray(table.area_at), count)
    area = values(heights, "area", edges)
    area[0] = 0.0  # level parts at the highest peak belong to the first strip
    within = np.diff(edges * area - values(heights, "volume", edges))  # integral of x over the area
    return _strips(within / np.diff(area), np.diff(area), roughness, stiffness_0, stiffness_t, mu)


def mindlin(contact: NormalContact, mu: float, deepest: float, count: int, axis: int = 0) -> Strips:
    """Cattaneo's and Mindlin's partial slip under a normal load that may vary, as Mindlin and Deresiewicz have it.

    With like bodies and Coulomb friction, every ring of a round contact acts like a flat punch of its own: the strips
    of a normal law F(delta) with the stiffness dF/ddelta and one ratio k_T/k_N (Jaeger, Arch. Appl. Mech. 65, 1995;
    Popov & Hess, method of dimensionality reduction). First loading is that of `partial_slip.PartialSlip`, mu N
    (1 - (1 - ...)^(3/2)) of a sphere. The strips' normal law goes straight between the approaches (i/count)^2 of the
    deepest, exact there and too large between, for a sphere by at most 3/(8 count^2) of the force at the deepest;
    the tangential force is off by at most mu times that. Beyond the deepest it goes straight on.

    Args:
        contact: `hertz.Hertz`, `profiles.RoundContact`, or one's own, of convex force. mu: friction coefficient.
        deepest: largest approach that is described, m. count: of strips. axis: of the elliptic contact, 0 or 1, that
            t1 lies along.

    Raises:
        UserError: a setting that is not positive, a force that is not convex.
    """
    _counted(count)
    refuse_not_positive(deepest=deepest, friction=mu)
    at = (np.arange(count + 1) / count) ** 2
    slopes = np.diff(np.asarray(contact.force(at * deepest))) / np.diff(at * deepest)
    rises = np.diff(slopes, prepend=0.0)
    if not (rises > 0).all():
        raise UserError("contact: the stiffness of its normal force does not rise with the approach; strips need that")
    shares = rises / slopes[-1]
    stiffness_t = slopes[-1] * contact.tangential_ratio[axis]
    law = _strips(at[:-1], shares, deepest, float(slopes[-1]), float(stiffness_t), mu)
    other = contact.tangential_ratio[1 - axis] / contact.tangential_ratio[axis]
    return replace(law, stiffness_ratio=None if other == 1 else jnp.asarray(other), includes=BULK)


def _strips(
    at: np.ndarray, shares: np.ndarray, depth: float, stiffness_0: float, stiffness_t: float, mu: float
) -> Strips:
    depth_, c_N0, c_R0, friction = (value(x) for x in (depth, stiffness_0, stiffness_t, mu))
    return Strips(jax.device_put(at[:, None]), jax.device_put(shares[:, None]), depth_, c_N0, c_R0, friction)


def _edges(x: np.ndarray, area: np.ndarray, count: int) -> np.ndarray:
    """(count + 1,) approaches with the same integral of the root of the density between them."""
    passed = np.concatenate([[0.0], np.cumsum(np.sqrt(np.diff(area) * np.diff(x)))])
    rises = np.concatenate([[True], np.diff(passed) > 0])
    return np.interp(np.linspace(0, passed[-1], count + 1), passed[rises], x[rises])


# the laws of a contact file ------------------------------------------------------------------------------------------


class _Parallel(LawKind):
    """Sliders in parallel, under Coulomb's friction."""

    partly: ClassVar[bool] = True

    def fits(self, contact: ContactLaw) -> None:
        if not isinstance(contact.friction, OfCoulomb):
            raise ValueError(f'law: "{self.kind}" slides by Coulomb; write [friction] kind = "coulomb"')
        if contact.friction.deviation:
            raise ValueError(f'law: "{self.kind}" takes no friction that scatters; remove friction.deviation')


class OfStrips(_Parallel):
    """Microslip by the strips of the rough surface (5.2-33), Coulomb friction in each."""

    kind: Literal["strips"]
    count: Annotated[int, Field(ge=2, le=500)] = 32
    """of strips"""

    def fits(self, contact: ContactLaw) -> None:
        super().fits(contact)
        if contact.roughness is None:
            raise ValueError("law: strips are those of a rough surface; add [roughness]")

    def law(self, contact: ContactModel) -> Law:
        (heights, roughness), first = contact.surface, contact.tangential[0]
        strips = rough_strips(contact.normal_0, roughness, heights, first, contact.mu, self.count)
        return replace(strips, stiffness_ratio=contact.ratio)


class OfIwan(_Parallel):
    """Microslip by Iwan's sliders in parallel; with an exponent by Segalman's four parameters."""

    kind: Literal["iwan"]
    count: Annotated[int, Field(ge=2, le=500)] = 32
    """of sliders"""
    weakest: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """strength of the weakest slider over that of the strongest"""
    exponent: Annotated[Number, Field(gt=-1, le=0)] | None = None
    """chi of Segalman's distribution"""
    ratio: NotNegative = 0.0
    """beta: stiffness of its last slider over that of all others"""

    def law(self, contact: ContactModel) -> Law:
        shares = uniform(self.count, self.weakest)
        if self.exponent is not None:
            shares = segalman(self.count, self.exponent, self.ratio)
        return Iwan(contact.normal, value(contact.mu), contact.springs[0], *shares, contact.ratio)


class OfMindlin(_Parallel):
    """Microslip of a Hertzian contact (Cattaneo, Mindlin) under a varying load; needs stiffness.kind = "hertz"."""

    kind: Literal["mindlin"]
    count: Annotated[int, Field(ge=2, le=500)] = 32
    """of sliders"""

    def fits(self, contact: ContactLaw) -> None:
        super().fits(contact)
        if not isinstance(contact.stiffness, OfHertz):
            raise ValueError('law: "mindlin" is the partial slip of curved bodies; write stiffness.kind = "hertz"')

    def law(self, contact: ContactModel) -> Law:
        given = contact.settings.stiffness
        assert contact.hertz is not None and isinstance(given, OfHertz)
        return mindlin(contact.hertz, contact.mu, contact.deepest, self.count, given.axis)
