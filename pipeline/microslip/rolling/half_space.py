"""Contact of two elastic half-spaces on a grid: pressing, shifting, rolling from moment to moment and steadily.

The reference among the models of rolling contact: any shape of the patch, unlike bodies, Coulomb's law, any mu(x, y).
The frame is that of the patch: x along rolling, material enters at the largest x; body 1 is the upper one, tractions,
forces and moment are those on it, slip is that of 1 relative to 2 over the rolling speed: s = w + du/dt / V with the
rigid slip w = (xi - phi y, eta + phi x), so a positive creepage gives a negative force (Kalker 1990, 1.3 and 4.3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ..data import Array, Flags
from ..errors import UserError
from ..interrupts import look
from ..settings.arguments import Vector, checked
from ..settings.numbers import Component, NotNegative, Positive
from .arguments import NotNegatives, Poisson, Reals
from .half_space_influence import (
    ALL,
    NORMAL,
    TANGENTIAL,
    Grid,
    Influence,
    Pair,
    influence,
    influence_ahead,
    influence_change,
)
from .half_space_tangential import TOLERANCE, Shear, tractions

ITERATIONS = 50
FASTEST = 1e4
"""Slip over the speed of rolling (of a shift m) up to which tractions are looked for."""
Forces = Sequence[float | None]


@dataclass(frozen=True)
class HalfSpaceContact:
    """What two half-spaces do to each other.

    Attributes:
        grid, pair: where, and of what. pressure: (nx, ny), Pa. traction: (2, nx, ny) tangential, on body 1, Pa. slip:
            (2, nx, ny) of 1 relative to 2 over the speed; of a shift, m. bound: (nx, ny) mu p_n, Pa. approach: m.
            motion: (xi, eta, phi), phi in 1/m; of a shift (m, m, rad).
    """

    grid: Grid
    pair: Pair
    pressure: Array
    traction: Array
    slip: Array
    bound: Array
    approach: float
    motion: Array

    @property
    def touching(self) -> Flags:
        """(nx, ny) where the bodies touch."""
        return self.pressure > 0

    @property
    def sticking(self) -> Flags:
        """(nx, ny) where they touch and the traction is below its bound."""
        return self.touching & (np.hypot(*self.traction) < (1 - 1e-5) * self.bound)

    @property
    def force(self) -> Array:
        """(F_x, F_y, F_n) on body 1, N."""
        return self.all_tractions.sum(axis=(1, 2)) * self.grid.area

    @property
    def moment(self) -> float:
        """M_z = sum (p_y x - p_x y) dA on body 1, N m."""
        p_x, p_y = self.traction
        return float((p_y * self.grid.x - p_x * self.grid.y).sum() * self.grid.area)

    @property
    def work(self) -> float:
        """Of friction, sum p s dA: J per metre of rolling, times the speed W; of a shift J. Negative: dissipated."""
        return float((self.traction * self.slip).sum() * self.grid.area)

    @property
    def all_tractions(self) -> Array:
        """(3, nx, ny): tangential ones and pressure, Pa."""
        return np.concatenate([self.traction, self.pressure[None]])

    @property
    def displacement(self) -> Array:
        """(3, nx, ny) of 1 relative to 2, m."""
        return influence(self.grid, self.pair)(self.all_tractions, ALL, ALL)

    @property
    def energy(self) -> float:
        """Stored in both bodies, J."""
        return float((self.all_tractions * self.displacement).sum() * self.grid.area / 2)


@dataclass(frozen=True)
class _Motion:
    """How the slip follows from the tractions: operator B of a grid, (3, 2, nx, ny) slips of the three rigid motions,
    and (2, nx, ny) what the tractions of a moment before add."""

    operator: Callable[[Grid], Influence]
    rigid: Array
    past: Array | float = 0.0


@checked
def pressed(
    distance: Reals, grid: Grid, pair: Pair, force: NotNegative | None = None, approach: Component | None = None
) -> HalfSpaceContact:  # fmt: skip
    """Bodies pressed together without friction.

    Args:
        distance: undeformed distance h(x, y) of the surfaces, broadcasts to (nx, ny), m. force: N, or approach: m.

    Raises:
        UserError: see `normal_contact`; the patch reaches the edge of the grid.
    """
    return _contact(distance, grid, pair, 0.0, force, approach, None, (0, 0, 0), (None, None), None)


@checked
def shifted(
    distance: Reals, grid: Grid, pair: Pair, friction: NotNegatives, force: NotNegative | None = None,
    approach: Component | None = None, shift: Vector = (0, 0, 0),
    tangential: Forces = (None, None), before: HalfSpaceContact | None = None,
) -> HalfSpaceContact:  # fmt: skip
    """Bodies pressed together, then shifted without rolling (Cattaneo's problem).

    Args:
        distance, force, approach: see `pressed`. friction: mu, a number or (nx, ny). shift: of body 1 along x and y
            (m) and its turn (rad). tangential: F_x, F_y on body 1 (N); where one is given its shift follows. before:
            the contact that is shifted further.

    Raises:
        UserError: see `pressed`; friction that is negative, forces beyond full slip, no convergence.
    """
    past = 0.0 if before is None else -before.displacement[:2]
    motion = _Motion(lambda g: influence(g, pair), _rigid(grid, 0.0), past)
    return _contact(distance, grid, pair, friction, force, approach, motion, shift, tangential, before)


@checked
def steady_rolling(
    distance: Reals, grid: Grid, pair: Pair, friction: NotNegatives, force: NotNegative | None = None,
    approach: Component | None = None, creepages: Vector = (0, 0, 0),
    tangential: Forces = (None, None), start: HalfSpaceContact | None = None,
) -> HalfSpaceContact:  # fmt: skip
    """Steady rolling towards +x.

    Args:
        distance, force, approach, friction: see `shifted`. creepages: xi, eta and the spin phi (1/m). tangential: F_x,
            F_y on body 1 (N); where one is given its creepage follows. start: a contact on the same grid whose answer
            is near.

    Raises:
        UserError: see `shifted`.
    """
    motion = _Motion(lambda g: influence_change(g, pair), _rigid(grid, grid.dx))
    return _contact(distance, grid, pair, friction, force, approach, motion, creepages, tangential, start)


@checked
def rolled(
    before: HalfSpaceContact, distance: Reals, friction: NotNegatives, force: NotNegative | None = None,
    approach: Component | None = None, creepages: Vector = (0, 0, 0),
    tangential: Forces = (None, None), step: Positive | None = None,
) -> HalfSpaceContact:  # fmt: skip
    """The next moment of transient rolling towards +x, in a frame that goes with the patch.

    Args:
        before: a moment ago. distance, friction, force, approach, creepages, tangential: now, see `steady_rolling`.
            step: distance rolled since, m; that of an element if not given.

    Raises:
        UserError: see `shifted`; a step that is not positive.
    """
    grid, pair = before.grid, before.pair
    step = grid.dx if step is None else step
    past = -influence_ahead(grid, pair, step)(before.all_tractions, TANGENTIAL, ALL) / step
    motion = _Motion(lambda g: influence(g, pair, step), _rigid(grid, step), past)
    return _contact(distance, grid, pair, friction, force, approach, motion, creepages, tangential, before)


def _rigid(grid: Grid, step: float) -> Array:
    """(3, 2, nx, ny) rigid slip per creepage; of spin a sixth of the step ahead of the centre, as CONTACT takes it."""
    ones = np.ones((grid.nx, grid.ny))
    return np.array([[ones, 0 * ones], [0 * ones, ones], [-grid.y * ones, (grid.x + step / 6) * ones]])


def _contact(
    distance: ArrayLike, grid: Grid, pair: Pair, friction: ArrayLike, force: float | None, approach: float | None,
    motion: _Motion | None, given: ArrayLike, tangential: Forces, start: HalfSpaceContact | None,
) -> HalfSpaceContact:  # fmt: skip
    """Pressure and traction in turns until both stay (Panagiotopoulos); like bodies need one turn."""
    h, mu, w = grid.field(distance, "distance"), grid.field(friction, "friction"), np.array(given, float)
    if w.shape != (3,):
        raise UserError(f"creepages: {given!r}; give three numbers, along x, along y and the spin or turn")
    if motion is not None and (fastest := np.abs(np.tensordot(w, motion.rigid, 1)).max()) > FASTEST:
        raise UserError(
            f"creepages: a slip of {fastest:.3g} times the speed is no rolling any more; creepages have no unit, the "
            "spin is in 1/m"
        )
    whole = influence(grid, pair)
    none = np.zeros((2, grid.nx, grid.ny))
    now = HalfSpaceContact(grid, pair, none[0], none, none, none[0], 0.0, w)
    if start is not None:
        now = replace(now, pressure=start.pressure, traction=start.traction, slip=start.slip * (start.pressure > 0))
    for _ in range(ITERATIONS):
        lift = whole(now.traction, NORMAL, TANGENTIAL)[0] if pair.mismatch else 0.0
        pressure, approach_now = normal_contact(h + lift, whole, grid.area, force, approach, start=now.pressure)
        sides = [pressure[0], pressure[-1], *((pressure[:, 0], pressure[:, -1]) if grid.ny > 1 else ())]
        if any(side.any() for side in sides):  # a grid of one row is two-dimensional
            raise UserError("grid: the patch reaches the edge of the grid and is cut off; take a larger grid")
        pressed_now = replace(now, pressure=pressure, approach=approach_now, bound=mu * pressure)
        then = pressed_now if motion is None else _sheared(pressed_now, motion, tangential, start is not None)
        change = max(np.abs(a - b).max() for a, b in ((then.traction, now.traction), (then.pressure, now.pressure)))
        now, start = then, then
        if not pair.mismatch or motion is None or change <= 10 * TOLERANCE * pressure.max():
            return now
    raise UserError(f"distance: pressure and traction have not settled after {ITERATIONS} turns; K is too large")


def _sheared(now: HalfSpaceContact, motion: _Motion, tangential: Forces, warm: bool) -> HalfSpaceContact:
    """Tangential problem under a given pressure; the creepage follows where a force is given."""
    if len(tangential) != 2:
        raise UserError(f"tangential: is {tangential!r}; give F_x and F_y, N, None where the creepage is given")
    wanted = [k for k in (0, 1) if tangential[k] is not None]
    sums = np.array([tangential[k] for k in wanted], float) / now.grid.area
    if wanted and not np.linalg.norm(sums) < now.bound.sum():
        limit = now.bound.sum() * now.grid.area
        raise UserError(f"tangential: a force that is not below mu F_n = {limit:.6g} N, so all slides; give a creepage")
    past = motion.past + motion.operator(now.grid)(now.pressure[None], TANGENTIAL, NORMAL)
    rigid = np.tensordot(now.motion, motion.rigid, 1) + past
    problem = Shear(motion.operator, now.grid, rigid, now.bound, motion.rigid[wanted], sums)
    traction, slip, amounts = tractions(problem, now.traction - problem.push * now.slip if warm else None)
    motion_then = now.motion.copy()
    motion_then[wanted] += amounts
    return replace(now, traction=traction, slip=slip * now.touching, motion=motion_then)


@checked
def linear_coefficients(ratio: Positive, poisson: Poisson, elements: Annotated[int, Field(ge=4)] = 40) -> Array:
    """Kalker's (C11, C22, C23, C33) of an elliptic patch that sticks everywhere (Kalker 1990, 4.2).

    F_x = -c^2 G C11 xi, F_y = -c^2 G C22 eta - c^3 G C23 phi, M_z = c^3 G C23 eta - c^4 G C33 phi, c^2 = a b. On
    `elements` by `elements`, on twice as many each way, and extrapolated: the error falls as 1/elements.

    Args:
        ratio: a/b, a along rolling. poisson: nu. elements: along each axis of the ellipse.

    Raises:
        UserError: a ratio that is not positive, another Poisson's ratio, fewer than four elements.
    """
    coarse, fine = (_coefficients(ratio, poisson, n) for n in (elements, 2 * elements))
    return 2 * fine - coarse


def _coefficients(ratio: float, poisson: float, n: int) -> Array:
    grid, pair = Grid.around(ratio**0.5, ratio**-0.5, n, n), Pair(1.0, poisson)
    patch = (grid.x**2 / ratio + grid.y**2 * ratio < 1) * 1e6
    none = np.zeros((0, 2, n, n))
    sums = []
    for rigid in _rigid(grid, grid.dx):
        p, _, _ = tractions(Shear(lambda g: influence_change(g, pair), grid, rigid, patch, none, np.zeros(0)))
        sums.append((-p[0].sum(), -p[1].sum(), (p[0] * grid.y - p[1] * grid.x).sum()))
    of_x, of_y, of_spin = np.array(sums) * grid.area
    size = (np.count_nonzero(patch) * grid.area / np.pi) ** 0.5  # of the ellipse that the elements cover
    return np.array([of_x[0] / size**2, of_y[1] / size**2, of_spin[1] / size**3, of_spin[2] / size**4])


# which elements touch, and how hard: conjugate gradients with p >= 0, for any undeformed distance

SETTLED, MOST = 1e-10, 2000
"""Change of the pressure over the largest one at which it has settled, and iterations at most."""


def normal_contact(
    distance: Array, influence: Influence, area: float, force: float | None = None, approach: float | None = None,
    start: Array | None = None,
) -> tuple[Array, float]:  # fmt: skip
    """Pressure that closes the distance where it acts: p >= 0, e = h - approach + u_n >= 0, p e = 0.

    Conjugate gradients on the elements that touch; those whose pressure turns negative let go, those that overlap
    join (Polonsky and Keer, Wear 231, 1999; Vollebregt, J. Comput. Phys. 257, 2014).

    Args:
        distance: (nx, ny) undeformed distance h of the surfaces, m. influence: of the grid. area: of an element, m^2.
            force: N, or approach: m, one of the two. start: a pressure to begin with, Pa.

    Returns:
        Pressure (nx, ny), Pa, and approach, m. No contact: zeros.

    Raises:
        UserError: neither or both of force and approach, no convergence.
    """
    if (force is None) == (approach is None):
        raise UserError("force, approach: give one of the two, the other follows")
    touching_at = float(distance.min())
    if force == 0 or (approach is not None and approach <= touching_at):
        return np.zeros(distance.shape), touching_at if approach is None else approach
    load = None if force is None else force / area
    pressure = _first(distance, influence, load, approach) if start is None or not np.any(start > 0) else start.copy()
    return _gradients(distance, influence, pressure, load, approach)


def _first(distance: Array, influence: Influence, load: float | None, approach: float | None) -> Array:
    """As if the elements did not feel each other, or all of them shared the load."""
    if load is not None:
        return np.full(distance.shape, load / distance.size)
    return np.maximum(approach - distance, 0) / influence(_unit(distance.shape), NORMAL, NORMAL).max()


def _unit(shape: tuple[int, ...]) -> Array:
    unit = np.zeros((1, *shape))
    unit[0, shape[0] // 2, shape[1] // 2] = 1
    return unit


def _gradients(
    distance: Array, influence: Influence, pressure: Array, load: float | None, approach: float | None
) -> tuple[Array, float]:  # fmt: skip
    def deformation(p: Array) -> Array:
        return influence(p[None], NORMAL, NORMAL)[0]

    single = float(deformation(_unit(distance.shape)[0]).max())
    if load is not None:
        pressure *= load / pressure.sum()
    direction, before, fresh = np.zeros_like(distance), 1.0, True
    for _ in range(MOST):
        look()
        touching = pressure > 0
        gap = deformation(pressure) + distance
        level = float(gap[touching].mean()) if load is not None else float(approach)  # type: ignore[arg-type]
        gap -= level
        here = float((gap[touching] ** 2).sum())
        direction = np.where(touching, gap + (0 if fresh else here / before) * direction, 0)
        answer = deformation(direction)
        if load is not None:
            answer -= answer[touching].mean()
        curvature = float((answer * direction)[touching].sum())
        joining = ~touching & (gap < 0)
        if curvature > 0:
            length = float((gap * direction)[touching].sum()) / curvature
        elif joining.any():  # those that touch are at rest among themselves
            length = 1 / single
        else:
            return pressure, level
        pressure_then = np.maximum(np.where(touching, pressure - length * direction, 0), 0)
        pressure_then[joining] = -length * gap[joining]
        fresh, before = bool(joining.any()), here
        if load is not None:
            pressure_then *= load / pressure_then.sum()
        change, pressure = np.abs(pressure_then - pressure).max(), pressure_then
        if change <= SETTLED * pressure.max() and not fresh:
            return pressure, level
    raise UserError(f"distance: the pressure has not settled after {MOST} iterations; take a finer grid")
