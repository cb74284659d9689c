"""How two faces meet: the frame of the second seen in that of the first, what lies between them, and their points.

A contact is looked at in the frame of its first face. The second one belongs to a body that stands turned and moved
against the first: a neighbour in a ring, a damper below a platform, a wire through a hole.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from ..data import Array, Interface
from ..errors import UserError
from ..frames import rotation
from .assembly import across

OPPOSITE = 5.0
"""Degrees by which two normals may miss being opposite; twice the taper of a shroud that is worn or badly ground."""

NOTICED = 0.5
"""Degrees from which a reader is told of it: over a patch of 10 mm this is a wedge of 0.09 mm, more than any contact
yields."""

NOTICEABLE = 0.01
"""Gap as drawn, over the size of the faces, from which a reader is told of it."""

OWN_FRAME = np.diag([-1.0, -1.0, 1.0])
"""Of a face whose normal is opposite and whose t2 is the first one's: t1 = t2 x n is then opposite too."""


@dataclass(frozen=True, eq=False)
class Pairing:
    """Two faces that meet.

    Attributes:
        frame: (6, 6) six rows of the second face to motions in the first one's frame, see `assembly.ContactFace.frame`.
        gap: m along the first one's normal from its origin to the second one's; negative where they overlap. NaN in
            own frames (`in_ring`), where nobody knows. offset: (2,) m along t1, t2 from the first origin to the
            second one. angle: rad by which the normals miss being opposite. messages: for a reader.
    """

    frame: Array
    gap: float
    offset: Array
    angle: float
    messages: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Place:
    """Where a body stands: x = turn x' + shift. turn: (3, 3) its axes to common ones. shift: (3,) m."""

    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    def then(self, turn: Array, about: Array) -> Place:
        """The body turned once more, about a point (3,) in common axes."""
        return Place(turn @ self.turn, turn @ (self.shift - about) + about)

    def seen_from(self, other: Place) -> Place:
        """The same place in another body's axes."""
        back = other.turn.T
        return Place(back @ self.turn, back @ (self.shift - other.shift))


def facing(
    first: Interface, second: Interface, place: Place | None = None, names: tuple[str, str] = ("first", "second")
) -> Pairing:
    """The pairing of a face with another body's.

    Args:
        place: of the second body in the first one's axes; None: it has the same axes. names: for messages.

    Raises:
        UserError: normals that are not opposite, or faces that do not lie on each other.
    """
    met, wrong = _meeting(first, second, place or Place())
    if wrong:
        advice = "name two faces that touch, or place the bodies so that these do"
        raise UserError(f"{_named(names)} do not face each other: {wrong}; {advice}")
    return met


def in_ring(
    first: Interface, second: Interface, axis: Array, point: Array, blades: int, names: tuple[str, str],
    sector: int = 1, place: Place | None = None,
) -> Pairing:  # fmt: skip
    """The pairing of a face with one of another body in a ring, its own neighbour perhaps.

    Where the second body, turned by the sectors between, does not face the first but does so as it is drawn (flat
    faces at +-b of a blade that is meant as a part of any ring), each body's contact frame is used as it is: the
    normals are taken as opposite and the directions t2 as the same.

    Args:
        axis, point: (3,) of rotation, in the first body's axes. blades: N. sector: by how many the second body stands
            further. names: for messages. place: of the second body in the first one's axes, in the same sector.

    Raises:
        UserError: neither holds.
    """
    drawn, angle = place or Place(), 2 * np.pi * sector / blades
    R = rotation(np.asarray(axis, dtype=float), angle)
    turned, wrong = _meeting(first, second, drawn.then(R, np.asarray(point, dtype=float)))
    if not wrong:
        return turned
    own = _own_frames(first, second, drawn, sector, blades)
    if own is None:
        axes = second.rotation @ drawn.turn.T
        raise UserError(
            f"{_named(names)} do not face each other: with the second turned by {np.degrees(angle):.4g} degrees "
            f"(sector {sector} of {blades}) {wrong}, and as they are drawn their normals are "
            f"{_degrees(first.rotation[0], -axes[0]):.3g} degrees from opposite, the directions t2 "
            f"{_degrees(first.rotation[2], axes[2]):.3g} degrees apart; name the faces of neighbours that touch, or "
            "check the number of blades and the rotation axis"
        )
    return own


def _meeting(first: Interface, second: Interface, place: Place) -> tuple[Pairing, str]:
    """How they meet, and what keeps them from it, in words."""
    away = first.rotation @ (place.turn @ second.origin + place.shift - first.origin)
    axes = second.rotation @ place.turn.T
    met = _met(first, axes, away[1:], float(away[0]))
    return met, _missing(met, first, second, axes)


def _named(names: tuple[str, str]) -> str:
    return f"interfaces '{names[0]}' and '{names[1]}'"


def _degrees(a: Array, b: Array) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _met(first: Interface, axes: Array, offset: Array, gap: float) -> Pairing:
    """axes: (3, 3) rows of the second face's frame in the first body's axes. offset: (2,) along t1, t2, gap: m."""
    arm = -offset @ first.rotation[1:]  # the faces touch, so what lies between them along n turns nothing
    angle = _degrees(axes[0], -first.rotation[0])
    messages: tuple[str, ...] = ()
    if angle > NOTICED:
        messages = (
            f"The normals of the faces miss being opposite by {angle:.2g} degrees; the contact is taken as "
            "flat, in the plane of the first.",
        )
    if abs(gap) > NOTICEABLE * np.max(first.extent, initial=0.0) > 0:
        words = "apart" if gap > 0 else "inside each other"
        messages += (f"The faces are drawn {1e3 * abs(gap):.3g} mm {words}; the contact counts from where they touch.",)
    return Pairing(across(first.rotation, axes, arm), gap, offset, float(np.radians(angle)), messages)


def _missing(met: Pairing, first: Interface, second: Interface, axes: Array) -> str:
    """What keeps two faces from lying on each other, in words; nothing if nothing does."""
    angle = np.degrees(met.angle)
    if angle > OPPOSITE:
        return f"their normals are {angle:.3g} degrees from opposite (at most {OPPOSITE:g})"
    halves = 0.5 * np.asarray(first.extent), 0.5 * np.asarray(second.extent)
    size = max(halves[0].max(), halves[1].max())
    if size == 0:  # points of bodies by hand, which may stand anywhere
        return ""
    there = axes[1:] @ (-met.offset @ first.rotation[1:])  # the first origin, seen by the second
    if not any((np.abs(at) <= half + 1e-6 * size).all() for at, half in zip((met.offset, there), halves, strict=True)):
        return (
            f"their centres lie {1e3 * np.linalg.norm(met.offset):.4g} mm apart in the contact plane, each outside "
            "the other face"
        )
    if abs(met.gap) > size:
        words = "apart along the normal" if met.gap > 0 else "inside each other"
        return f"they lie {1e3 * abs(met.gap):.4g} mm {words}, more than half of their size"
    return ""


def _own_frames(first: Interface, second: Interface, drawn: Place, sector: int, blades: int) -> Pairing | None:
    """See `in_ring`; None where the faces as drawn are not opposite, have other tangents or pass by each other."""
    there = second.rotation @ drawn.turn.T
    normal, tangent = _degrees(there[0], -first.rotation[0]), _degrees(there[2], first.rotation[2])
    if max(normal, tangent) > OPPOSITE:
        return None
    offset = first.rotation[1:] @ (drawn.turn @ second.origin + drawn.shift - first.origin)
    axes = OWN_FRAME @ first.rotation
    if _missing(Pairing(np.eye(6), 0.0, offset, 0.0), first, second, axes):
        return None
    message = (
        f"Turned by {360 * sector / blades:.4g} degrees the faces of neighbours do not meet, as drawn they are "
        "opposite: each blade's own contact frame is used, as if the wedge between them were filled."
    )
    arm = -offset @ first.rotation[1:]
    return Pairing(across(first.rotation, axes, arm), float("nan"), offset, float(np.radians(normal)), (message,))


def rigid_points(interface: Interface, counts: tuple[int, int] | None = None) -> tuple[Array, Array]:
    """Points of a patch that moves as a rigid body.

    Args:
        counts: n_y, n_z rectangles along t1 and t2 over the outline (Sextro Eq. (5.2-1)), each cut at the outline, and
            slivers joined to their neighbours; None: the interface's own quadrature points.

    Returns:
        (n, 2) places along t1 and t2 from the interface's origin, m, and (n,) areas, m2.
    """
    T = interface.rotation[1:].T
    if counts is None:
        return (interface.points - interface.origin) @ T, np.array(interface.areas)
    if not len(interface.polygon):
        b, h = interface.extent
        return _cells(np.array([[-b, -h], [b, -h], [b, h], [-b, h]]) / 2, counts)
    return _cells((interface.polygon - interface.origin) @ T, counts)


def _cells(outline: Array, counts: tuple[int, int]) -> tuple[Array, Array]:
    """Centres of area and areas of the rectangles of a convex outline's box, cut at it; empty ones are left out, and
    slivers become parts of the piece nearest to them."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    y, z = (np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True))
    whole = np.prod((high - low) / counts)
    found = []
    for i in range(counts[0]):
        strip = _cut(_cut(outline, 0, y[i], 1.0), 0, y[i + 1], -1.0)
        for j in range(counts[1]):
            centre, area = _centroid(_cut(_cut(strip, 1, z[j], 1.0), 1, z[j + 1], -1.0))
            if area > 1e-9 * whole:
                found.append((*centre, area))
    rows = np.array(found).reshape(-1, 3)
    return _joined(rows[:, :2], rows[:, 2], SLIVER * whole)


SLIVER = 0.1
"""Share of a whole rectangle below which what the outline leaves of it carries no point of its own."""


def _joined(points: Array, areas: Array, least: float) -> tuple[Array, Array]:
    """Pieces (n, 2) and (n,) with those smaller than `least` joined to the nearest that is not: the area and its first
    moments stay."""
    large = np.flatnonzero(areas >= least)
    if not len(large):
        return points, areas
    to = large[cKDTree(points[large]).query(points)[1]]
    joined = np.bincount(to, areas, len(areas))[large]
    moment = np.column_stack([np.bincount(to, areas * x, len(areas))[large] for x in points.T])
    return moment / joined[:, None], joined


def _cut(corners: Array, axis: int, at: float, sign: float) -> Array:
    """Part of a convex polygon (k, 2) beyond (sign 1) or before (-1) a line across an axis."""
    if not len(corners):
        return corners
    height = sign * (corners[:, axis] - at)
    kept = []
    for p, q, a, b in zip(corners, np.roll(corners, -1, axis=0), height, np.roll(height, -1), strict=True):
        if a >= 0:
            kept.append(p)
        if a * b < 0:
            kept.append(p + (q - p) * a / (a - b))
    return np.array(kept).reshape(-1, 2)


def _centroid(corners: Array) -> tuple[Array, float]:
    """Centre of area (2,) and area of a convex polygon (k, 2)."""
    if len(corners) < 3:
        return np.zeros(2), 0.0
    p = corners - corners[0]
    q = np.roll(p, -1, axis=0)
    parts = 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    area = parts.sum()
    if not abs(area) > 0:
        return corners[0], 0.0
    return corners[0] + parts @ (p + q) / (3 * area), abs(float(area))
