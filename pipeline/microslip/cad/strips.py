"""Round sections whose outline is cut where a line contact ends, to be swept into pins, wires and holes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import gmsh
import numpy as np

from microslip.data import Array
from microslip.errors import UserError


def round_section(centre: Array, axes: Array, radius: float, strips: Sequence[tuple[float, float]]) -> int:
    """Tag of a disc whose circle is cut into strips of contact and the arcs between them.

    Args:
        centre: (3,). axes: (2, 3) unit vectors of the plane; angles count from the first towards the second.
        strips: (angle of the middle in radians, width along the arc) of each strip.

    Raises:
        UserError: strips that overlap.
    """
    add = gmsh.model.occ
    angles = cuts(radius, strips)
    middle = add.addPoint(*centre)
    points = [add.addPoint(*(centre + radius * (np.array([np.cos(a), np.sin(a)]) @ axes))) for a in angles]
    arcs = [add.addCircleArc(a, middle, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    return int(add.addPlaneSurface([add.addCurveLoop(arcs)]))


def cuts(radius: float, strips: Sequence[tuple[float, float]]) -> list[float]:
    """Rising angles of the ends of the strips, and of points between them so that no arc reaches half a circle."""
    ends = sorted((angle - width / radius / 2, angle + width / radius / 2) for angle, width in strips)
    following = [*ends[1:], (ends[0][0] + 2 * math.pi, 0.0)]
    found: list[float] = []
    for (low, high), (after, _) in zip(ends, following, strict=True):
        if after <= high:
            raise UserError(f"strips of contact overlap on a circle of radius {radius:g}; make them narrower")
        parts = math.ceil((after - high) / 2.0)
        found += [low, *(high + (after - high) * i / parts for i in range(parts))]
    return found


def strip_centre(radius: float, width: float) -> float:
    """Distance from the axis to the area centre of a strip of a circular cylinder, `width` along the arc."""
    half = width / radius / 2
    return radius * math.sin(half) / half
