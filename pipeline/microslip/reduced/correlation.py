"""How alike the modes of two bodies are: MAC, pairs of modes, frequency table, points of one on points of the other.

The bodies may be computed or measured. Of a measured one only the directions that were measured count; they are the
rows of its monitors (`measured_directions`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.spatial

from ..data import Array, Indices, ModalBasis, ModalGroup
from ..errors import UserError
from .coordinates import in_modes

DIRECTIONS = ("u_x", "u_y", "u_z")
POINT = "point "
"""A measured body has a monitor of this name and the point's number for every measured point."""


def mac(A: Array, B: Array) -> Array:
    """(a, b) modal assurance criterion |A_i^H B_j|^2 / (A_i^H A_i B_j^H B_j) of two sets of shapes.

    1: the same shape up to a factor; 0: nothing in common. A shape that vanishes has 0 with every other.

    Args:
        A: (d, a), B: (d, b): shapes as columns over the same d degrees of freedom, real or complex.

    Source:
        Allemang and Brown, A correlation coefficient for modal vector analysis, IMAC 1982.
    """
    cross = np.abs(A.conj().T @ B) ** 2
    own = np.outer((np.abs(A) ** 2).sum(axis=0), (np.abs(B) ** 2).sum(axis=0))
    return np.divide(cross, own, out=np.zeros_like(own), where=own > 0)


@dataclass(frozen=True)
class Pair:
    """A mode of one body and the mode of another that is most like it.

    Attributes:
        first, second: numbers of the modes, counted from 0. frequency: of both, Hz. mac: of the two shapes.
        damping_ratio: of both.
    """

    first: int
    second: int
    frequency: tuple[float, float]
    mac: float
    damping_ratio: tuple[float, float] = (0.0, 0.0)

    @property
    def deviation(self) -> float:
        """Relative deviation of the second frequency from the first; NaN of a rigid motion."""
        a, b = self.frequency
        return (b - a) / a if a > 0 else float("nan")


def pairs(likeness: Array, first: Array, second: Array, least: float = 0.5) -> list[Pair]:
    """Every mode with the one that suits it best: pairs one to one with the largest sum of MAC, by rising frequency.

    Args:
        likeness: (a, b) MAC. first: (a,), second: (b,) frequencies, Hz. least: MAC below which modes stay unpaired.
    """
    rows, columns = scipy.optimize.linear_sum_assignment(likeness, maximize=True)
    return [
        Pair(int(i), int(j), (float(first[i]), float(second[j])), float(likeness[i, j]))
        for i, j in zip(rows, columns, strict=True)
        if likeness[i, j] >= least
    ]


def nearest_points(asked: Array, points: Array, limit: float, names: Indices | None = None) -> tuple[Indices, Array]:
    """Number and distance (m) of the point nearest to each one asked for.

    Args:
        asked: (p, 3), points: (n, 3), m, in one frame. limit: m, largest distance accepted. names: (p,) numbers of
            the points asked for, for the message.

    Raises:
        UserError: a point is farther away than `limit`, or two share one nearest point.
    """
    found = scipy.spatial.cKDTree(points).query(asked)
    distance, at = np.asarray(found[0]), np.asarray(found[1])
    numbers = np.arange(1, len(asked) + 1) if names is None else names
    if (far := distance > limit).any():
        worst = int(distance.argmax())
        place = ", ".join(f"{v:.4g}" for v in asked[worst])
        raise UserError(
            f"point {numbers[worst]} at ({place}) m is {distance[worst]:.3g} m from the nearest node of "
            f"the other body, {int(far.sum())} of {len(far)} points are beyond {limit:.3g} m; are both in one frame "
            "and one unit of length? Move the points, or allow a larger distance"
        )
    chosen, count = np.unique(at, return_counts=True)
    if (count > 1).any():
        doubled = numbers[at == chosen[count.argmax()]]
        raise UserError(
            f"points {', '.join(map(str, doubled))} have the same nearest node of the other body; its mesh is too "
            "coarse there, or the points are in another unit of length"
        )
    return at, distance


def measured_directions(basis: ModalBasis, group: ModalGroup) -> Array:
    """(n, 3) bool: which displacements of its points a body knows: all of a computed one."""
    known = np.ones((basis.mesh.n_points, 3), dtype=bool)
    if basis.source != "measured":
        return known
    known[:] = False
    position = {int(number): i for i, number in enumerate(basis.mesh.node_id)}
    for name, rows in group.monitors.items():
        if name.startswith(POINT):
            known[position[int(name.removeprefix(POINT))]] = [d in rows.labels for d in DIRECTIONS]
    return known


@dataclass(frozen=True)
class Comparison:
    """Two bodies over the degrees of freedom that both know.

    Attributes:
        mac: (a, b). pairs: see `pairs`. first_frequency: (a,), second_frequency: (b,) Hz. points: how many were
            compared. directions: how many displacements. distance: (p,) m, between the points that were laid on each
            other.
    """

    mac: Array
    pairs: tuple[Pair, ...]
    first_frequency: Array
    second_frequency: Array
    points: int
    directions: int
    distance: Array


def compare_groups(
    first: ModalBasis, second: ModalBasis, key: tuple[int, int] = (0, 0), limit: float | None = None, least: float = 0.5
) -> Comparison:
    """MAC and pairs of two bodies in one frame, at the points of the one that has fewer.

    Args:
        key: speed (counted from 0) and nodal diameter. limit: m, largest distance between points that are taken for
            the same; a hundredth of the body's size if not given. least: see `pairs`.

    Raises:
        UserError: a body without shapes or without that group; points that do not lie on each other; nothing in common.
    """
    few, many = (first, second) if first.mesh.n_points <= second.mesh.n_points else (second, first)
    groups = {id(b): _own(b, key) for b in (first, second)}
    size = float(np.ptp(many.mesh.points, axis=0).max())
    asked = few.mesh.points
    at, distance = nearest_points(asked, many.mesh.points, 0.01 * size if limit is None else limit, few.mesh.node_id)
    known = measured_directions(few, groups[id(few)]) & measured_directions(many, groups[id(many)])[at]
    if not known.any():
        raise UserError(f"'{first.name}' and '{second.name}' know no displacement in common")
    shapes = {id(few): groups[id(few)].phi[known], id(many): groups[id(many)].phi[at][known]}
    a, b = groups[id(first)], groups[id(second)]
    likeness = mac(shapes[id(first)], shapes[id(second)])
    found = tuple(_damped(p, a, b) for p in pairs(likeness, a.frequency, b.frequency, least))
    points = int(known.any(axis=1).sum())
    return Comparison(likeness, found, a.frequency, b.frequency, points, int(known.sum()), distance)


def _damped(p: Pair, a: ModalGroup, b: ModalGroup) -> Pair:
    ratios = float(a.damping_ratio[p.first]), float(b.damping_ratio[p.second])
    return Pair(p.first, p.second, p.frequency, p.mac, ratios)


def _own(basis: ModalBasis, key: tuple[int, int]) -> ModalGroup:
    """A group in its own modes, with shapes."""
    if key not in basis.groups:
        raise UserError(f"'{basis.name}' has no speed {key[0]} with nodal diameter {key[1]}")
    group = in_modes(basis.groups[key])
    if not group.phi.shape[0]:
        raise UserError(f"'{basis.name}' holds no shapes (output.shapes = false): there is nothing to compare")
    return group


def pair_rows(found: Comparison) -> str:
    """The pairs as CSV: numbers counted from 1, Hz, relative deviation, MAC, damping ratios."""
    lines = ["first,second,first Hz,second Hz,deviation,MAC,first D,second D"]
    for p in found.pairs:
        (f, g), (a, b) = p.frequency, p.damping_ratio
        deviation = f"{p.deviation:.6g}" if f > 0 else ""
        lines.append(f"{p.first + 1},{p.second + 1},{f:.9g},{g:.9g},{deviation},{p.mac:.6f},{a:.6g},{b:.6g}")
    return "\n".join(lines) + "\n"


def pair_table(found: Comparison) -> list[str]:
    """Lines for the terminal: pairs with frequencies, damping and MAC, then the modes that have no partner."""
    lines = [f"{'mode':>5s} {'Hz':>12s}   {'mode':>5s} {'Hz':>12s} {'deviation':>10s} {'MAC':>7s}   D, D"]
    for p in found.pairs:
        f, g = p.frequency
        rest = f"{100 * p.deviation:+9.2f}%" if f > 0 else f"{'rigid':>10s}"
        damping = ", ".join(f"{d:.3g}" for d in p.damping_ratio)
        lines.append(f"{p.first + 1:5d} {f:12.6g}   {p.second + 1:5d} {g:12.6g} {rest} {p.mac:7.4f}   {damping}")
    for which, frequency, taken in (
        ("first", found.first_frequency, {p.first for p in found.pairs}),
        ("second", found.second_frequency, {p.second for p in found.pairs}),
    ):
        alone = [f"{i + 1} ({f:.6g} Hz)" for i, f in enumerate(frequency) if i not in taken]
        if alone:
            lines.append(f"without a partner in the {which}: {', '.join(alone)}")
    distance = float(found.distance.max(initial=0.0))
    lines.append(f"{found.points} points, {found.directions} displacements; points at most {distance:.3g} m apart")
    return lines
