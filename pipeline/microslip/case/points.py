"""From a contact's settings to its points: rigid patches, patches that deform, curved faces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..contact.curved import WIDEST, Foundation, Line, apart, foundation_of_line, foundation_of_point, gap, point_curve
from ..contact.friction import Coulomb
from ..contact.hertz import Hertz
from ..contact.kinds import LawKind
from ..contact.law import Law
from ..contact.patch import Patch, equilibrium, grid, pressure
from ..contact.point_laws import curve_point
from ..contact.portion import portion
from ..contact.solids import Solid
from ..data import Array, Interface
from ..errors import UserError, at
from ..system.nodal import Nodal
from ..system.pairing import SLIVER, rigid_points
from ..units import counted, percent
from .compliance import Springs
from .settings import CaseSettings, ContactSettings


def patch_of(c: ContactSettings, whole: Law, what: LawKind, face: Interface, load: float | None) -> Patch:
    """The points of a patch that moves as a rigid body (Sextro Eqs. (5.2-1), (5.2-34)).

    Args:
        whole: law of the full area. what: its settings. face: of the first side. load: N that the contact is about
            pressed by.
    """
    own = None if c.points else what.places(c.width or 0.0, c.height or 0.0)
    points, areas = own or _points(c, face, _counts(c, load))
    return Patch(c.interface, points, areas, _curved(c, _shared(whole, areas), points))


def nodal_patch(c: ContactSettings, whole: Law, found: Nodal) -> Patch:
    """The points of a patch that deforms. whole: law of the full area."""
    law_of_points = _curved(c, _shared(whole, found.areas), found.points)
    return Patch(c.interface, found.points, found.areas, law_of_points, found.shapes)


def _shared(whole: Law, areas: Array) -> Law:
    """The law of points that share out a contact by their areas."""
    import jax.numpy as jnp

    even = not areas.any() or bool(np.ptp(areas) <= 1e-12 * areas.max())
    return portion(whole, jnp.asarray(1 / len(areas) if even else areas / areas.sum()))


FEWEST, ENOUGH = 3, 6
"""Points across a curved contact that are refused below, and told below."""


def resolved(c: ContactSettings, patch: Patch, load: float | None) -> list[str]:
    """A message where few points of a curved patch are pressed at the load that it is fitted for.

    Raises:
        UserError: so few that the contact falls between them.
    """
    if c.curvature is None or not load or len(patch.points) == 1 or c.fit == "exact":
        return []
    pressed = patch.points[pressure(patch, equilibrium(patch, load)) > 0]
    across = [len(np.unique(np.round(pressed[:, i], 9))) for i in (0, 1) if np.isfinite(c.curvature[i])]
    least = min(across, default=0)
    if least >= ENOUGH:
        return []
    words = f"{least} points in a row are pressed at {load:g} N"
    if least < FEWEST:
        raise UserError(f'points: {words}; take more points, a narrower face, or fit = "exact"')
    return [f"{c.interface}: {words}; at least {ENOUGH} give its pressure: take more points, or a narrower face."]


def _counts(c: ContactSettings, load: float | None) -> tuple[int, int]:
    """How many points along t1 and t2: as asked for, or twice `ENOUGH` across a curved contact."""
    if c.points or c.young is None:
        return c.points or (24, 5)
    found, *_ = _foundation(c, _fitted(c, load))
    line = _line(c)
    approach = _ellipse(c).approach(found.force) if line is None else line.approach(found.force, _strip(c))
    counts = []
    for size, radius in zip((c.width or 0.0, c.height or 0.0), c.curvature or (), strict=True):
        wide = 2 * np.sqrt(2 * radius * found.approach * float(approach))
        counts.append(4 if np.isinf(wide) else int(np.clip(np.ceil(2 * ENOUGH * size / wide), 2 * ENOUGH, 400)))
    return counts[0], counts[1]


def number_of_points(c: ContactSettings, load: float | None) -> int:
    """Of a patch that moves as a rigid body, before they are made; an outline may leave fewer."""
    sizes = zip(_counts(c, load), (c.width, c.height), strict=True)
    return int(np.prod([count if size else 1 for count, size in sizes]))


def _points(c: ContactSettings, face: Interface, asked: tuple[int, int]) -> tuple[Array, Array]:
    """Places and areas: a rectangle as the settings have it, or what the outline leaves of it."""
    width, height = c.width or 0.0, c.height or 0.0
    counts = (asked[0] if width else 1, asked[1] if height else 1)
    if len(face.polygon) > 2 and width and height:
        places, areas = rigid_points(face, counts)
        if abs(areas.sum() / (width * height) - 1) > 0.01:  # not a rectangle
            return places, areas
    return grid(width, height, counts)


def cut_at_the_outline(c: ContactSettings, patch: Patch) -> list[str]:
    """A message where the outline of a face leaves other points than are asked for."""
    if c.points is None or c.fit == "exact" or len(patch.points) == number_of_points(c, None):
        return []
    return [
        f"{c.interface}: points = [{c.points[0]}, {c.points[1]}] makes {counted(len(patch.points), 'point')}: the face "
        f"is no rectangle along t1 and t2, its outline cuts the rectangles, and what is less than {percent(SLIVER)} of "
        "one joins its neighbour; t2 of the interface turns them."
    ]


# curved faces -------------------------------------------------------------------------------------------------------


def follows_the_force(c: ContactSettings) -> bool:
    """Whether the law of a contact depends on the very force of the sweep that presses it: a curved one is fitted at
    it, of a Jenkins element it is the friction limit."""
    made_for_it = c.what.of_the_force or (c.young is not None and c.fitted_at is None)
    return made_for_it and c.normal_force is None and c.interference is None


def fitting_forces(settings: CaseSettings, c: ContactSettings) -> tuple[float | None, ...]:
    """Normal forces (N) at which a curved contact is fitted: its own, or those of the sweep, rising; None: unknown.

    Of a contact whose law is the same under all of them the largest stands for them.
    """
    swept = settings.sweep.normal_forces
    if c.fitted_at is not None or c.normal_force is not None:
        return (c.fitted_at or c.normal_force,)
    if not isinstance(swept, tuple) or c.interference is not None:
        return (None,)
    return tuple(sorted(set(swept))) if follows_the_force(c) else (max(swept),)


def curved_springs(c: ContactSettings, load: float | None) -> tuple[Springs, str]:
    """Stiffness of a patch (N/m) whose points carry a curved contact as Hertz has it at a load, and what it matches."""
    found, around, along = _foundation(c, _fitted(c, load))
    n = found.stiffness * (c.width or 0.0) * (c.height or 0.0)
    t1, t2 = _tangential(c, around, along)
    words = "" if c.fit == "exact" else f"{c.interface}: {found.sentence}"
    return (n, t1 * n, t2 * n), words


def _tangential(c: ContactSettings, around: float, along: float) -> tuple[float, float]:
    """Tangential over normal stiffness along t1 and t2."""
    if c.isotropic:
        around = along = float(np.sqrt(around * along))
    return (along, around) if _lies_along(c) == "t1" else (around, along)


def _foundation(c: ContactSettings, load: float) -> tuple[Foundation, float, float]:
    """The foundation, and tangential over normal stiffness around and along the line."""
    fit = "approach" if c.fit == "exact" else c.fit
    if (line := _line(c)) is not None:
        return foundation_of_line(line, load, _strip(c), fit), *line.tangential_ratio
    ball = _ellipse(c)
    x, y = ball.tangential_ratio
    return foundation_of_point(ball, load, fit), *((y, x) if _lies_along(c) == "t1" else (x, y))


def pieces(c: ContactSettings, load: float | None) -> Patch:
    """Pieces of a line of contact, or one round contact, each a point with Hertz' own law."""
    import jax.numpy as jnp

    friction, most = Coulomb(jnp.asarray(c.coefficient, dtype=float)), 4 * _fitted(c, load)
    width, height = c.width or 0.0, c.height or 0.0
    line = _line(c)
    if line is None:
        ball = _ellipse(c)
        try:
            curve = point_curve(ball, most, (width, height))
        except UserError:  # four times the load fills the face: up to the load itself then
            curve = point_curve(ball, most / 4, (width, height))
        x, y = ball.tangential_ratio
        ratio = (x, y) if not c.isotropic else (float(np.sqrt(x * y)),) * 2
        return Patch(c.interface, *grid(width, height, (1, 1)), curve_point(curve, ratio, friction))
    along = _lies_along(c)
    count = (c.points or (8, 8))[0 if along == "t1" else 1]
    points, areas = grid(width, height, (count, 1) if along == "t1" else (1, count))
    piece = type(line)(line.first, line.second, line.radius, line.length / count)
    widest = float(piece.force_of(0.5 * WIDEST * _strip(c)))
    if _fitted(c, load) / count > widest:
        line.curve(_fitted(c, load), _strip(c))  # says why not
    curve, ratio = piece.curve(min(most / count, widest), _strip(c)), _tangential(c, *line.tangential_ratio)
    return Patch(c.interface, points, areas, curve_point(curve, ratio, friction))


def _curved(c: ContactSettings, law: Law, points: Array) -> Law:
    if c.curvature is None:
        return law
    with at("curvature"):
        return apart(law, gap(points, c.curvature))


def _fitted(c: ContactSettings, load: float | None) -> float:
    if not load:
        raise UserError(
            "fitted_at: a curved contact is fitted to Hertz at a load, which neither normal_force nor the sweep gives; "
            "give fitted_at in N"
        )
    return load


def _lies_along(c: ContactSettings) -> str:
    """``t1`` or ``t2``: the flatter direction."""
    assert c.curvature is not None
    return "t1" if c.curvature[0] >= c.curvature[1] else "t2"


def _strip(c: ContactSettings) -> float:
    """Width (m) of the face across the line."""
    return (c.height if _lies_along(c) == "t1" else c.width) or 0.0


def _line(c: ContactSettings) -> Line | None:
    """The line of contact, or None where both directions are curved."""
    assert c.curvature is not None and c.young is not None
    if np.isfinite(max(c.curvature)):
        return None
    solid = Solid(c.young, c.poisson)
    length = (c.width if _lies_along(c) == "t1" else c.height) or 0.0
    return Line(solid, solid, min(c.curvature), length)


def _ellipse(c: ContactSettings) -> Hertz:
    assert c.curvature is not None and c.young is not None
    solid = Solid(c.young, c.poisson)
    return Hertz(solid, solid, *(0.5 / r for r in c.curvature))


def waves(settings: CaseSettings) -> Sequence[int]:
    """Indices of the ring's waves in which the case moves, see `system.assembly.Ring.index`; all of a whole ring."""
    ring = settings.ring
    if ring is not None and ring.model == "full":
        return range(ring.blades // 2 + 1)
    order = settings.base_order
    return [0] if ring is None else sorted({h * order % ring.blades for h in range(settings.balanced + 1)})
