"""Wear of rolling bodies: volume proportional to frictional work, strip by strip, Sextro 6.8.

Fields have shape (nx, ny), x along rolling; a strip is all elements of one y. Depths are positive and count into the
body, so a worn body stands further off: undeformed distance + depth. One coefficient a body, m^3/J.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..data import Array
from ..errors import UserError
from ..settings.arguments import Rows, checked
from ..settings.numbers import NotNegative, Positive
from .arguments import Positives
from .strips import Tractions


@checked
def depth_along(source: Rows, dx: Positives, coefficient: NotNegative, speed: Positive) -> Array:
    """Depth of what passes each element's rear side, Sextro Eqs. (6.8-3), (6.8-4): it grows from the leading edge.

    Args:
        source: (nx, ny) frictional power per area q, W/m^2. dx: length of an element, m. coefficient: I, m^3/J. speed:
            of the contact over the body, m/s.

    Returns:
        (nx, ny) m.

    Raises:
        UserError: a speed that is not positive, a negative coefficient.
    """
    return np.cumsum((coefficient / speed * dx * source)[::-1], axis=0)[::-1]


def strip_depth(source: Array, dx: float, coefficient: float, speed: float) -> Array:
    """(ny,) m that one run-over takes off each strip, Sextro Eq. (6.8-6); see `depth_along`."""
    return depth_along(source, dx, coefficient, speed)[0]


def strip_work(t: Tractions) -> tuple[Array, Array]:
    """(n, ny) m widths of the strips of n patches, and the work of friction over each in a passage, J/m^2: times a
    coefficient of wear what it takes off (6.8-6)."""
    width = t.area[..., 0] / (t.x[..., 1] - t.x[..., 0])
    return width, (t.power * t.area).sum(axis=-1) / width


def deposited(depth: Array, dy: float | Array, middle: float, y: Array) -> Array:
    """Depths of strips brought to strips elsewhere; what is worn off stays the same.

    Args:
        depth: (m,) m, on strips of width dy (m, of all or of each) about `middle` (m). y: (n,) middles of evenly spaced
            strips, m.

    Returns:
        (n,) m.

    Raises:
        UserError: worn strips beyond the ends of y.
    """
    width = y[1] - y[0]
    ends = np.append(y - width / 2, y[-1] + width / 2)
    if np.ndim(dy):
        edges = np.append(0, np.cumsum(dy)) - np.sum(dy) / 2 + middle
    else:
        edges = middle + dy * (np.arange(len(depth) + 1) - len(depth) / 2)
    worn = np.flatnonzero(depth)
    if worn.size and not (ends[0] <= edges[worn[0]] and edges[worn[-1] + 1] <= ends[-1]):
        raise UserError("y: the contact wears beyond the ends of the profile; take a wider one")
    area = np.append(0, np.cumsum(depth * dy))
    return np.diff(np.interp(ends, edges, area)) / width


def revolution(contact: Callable[[int], tuple[Array, float, float] | None], positions: int, y: Array) -> Array:
    """Map of what one revolution of a wheel, or one run along a rail, takes off.

    Args:
        contact: number of a position -> (depth of the strips, their width, their middle) as `deposited` takes them, or
            None where the bodies are apart. positions: how many, evenly spaced. y: (n,) strips of the profile, m.

    Returns:
        (positions, n) m.
    """
    contacts = [contact(k) for k in range(positions)]
    return np.array([np.zeros(len(y)) if strips is None else deposited(*strips, y) for strips in contacts])


def smoothed(depth: Array, dy: float, length: float) -> Array:
    """Depth across the profile (last axis) as a Gaussian of this standard deviation (m) sees it; its mean stays.

    Curvatures are taken from this one: a wave of wave number k enters them by k^2 exp(-(k length)^2/2) instead of k^2,
    never by more than 2/(e length^2).
    """
    return gaussian_filter1d(depth, length / dy, axis=-1, mode="reflect", truncate=6.0) if length > 0 else depth


def shortest_smoothing(depth: float, gain: float) -> float:
    """Length (m) with which a worn profile that is updated in steps does not amplify itself.

    Args:
        depth: that wears between two updates, m. gain: relative change of it by the curvature z'' of the worn depth,
            d ln(depth)/d z'', m, positive.

    Returns:
        sqrt(depth gain/e). A wave is multiplied by 1 - depth gain k^2 exp(-(k length)^2/2) at each update, which is
        above -1 for all k exactly when length^2 > depth gain/e; unsmoothed, on strips of width dy, by as much as
        1 - 4 depth gain/dy^2: it grows where dy^2 < 2 depth gain.
    """
    return float(np.sqrt(depth * gain / np.e))


def worn(
    run: Callable[[Array], Array], start: Array, dy: float, updates: int, repeats: float, length: float
) -> Array:  # fmt: skip
    """A profile that wears: run on it, take off what that wears, run again (Sextro Fig. 6.8-4).

    Args:
        run: worn depth as the contact sees it -> what one run takes off, both of the shape of start, m. start: depth
            before, strips along the last axis. dy: their width, m. updates: how often the profile is renewed. repeats:
            runs between two updates. length: of `smoothed`, for what the contact sees alone; nothing worn is lost.

    Returns:
        Depth after, m.
    """
    depth = np.array(start, float)
    for _ in range(updates):
        depth = depth + repeats * run(smoothed(depth, dy, length))
    return depth
