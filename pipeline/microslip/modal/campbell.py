"""Modes followed over the rotation speed, and where engine orders meet them. Pure numpy and scipy.

Between two speeds the squared frequency is taken as linear in the squared speed (Southwell: omega^2 =
omega_0^2 + B Omega^2), which is exact at the stations and makes every crossing a root in closed form.
Gyroscopic coupling is not in the frequencies of a modal file; the modes with it stand beside (`track_gyroscopic`). Of
these omega^2 = omega_0^2 + B Omega^2 + 2 g omega, with g linear in the speed: two whirls of one mode exactly.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, Indices, ModalBasis, ModalGroup, SpeedRange
from .speed_range import frequencies_over, waves_over

LINK = 0.3
"""Two shapes with a smaller MAC than this are never taken for the same mode."""

SURE = 0.8
"""A step with a smaller MAC is drawn as uncertain: add speeds in between."""

VISIBLE = 0.005
"""A smaller relative change of the frequencies by gyroscopic coupling is told, but neither drawn nor met."""


@dataclass(frozen=True)
class Tracks:
    """Curves of frequency over speed.

    Attributes:
        speeds: (s,) rad/s, ascending.
        modes: (c, s) mode number (0-based) of each curve at each speed, -1 where the curve does not exist.
        omega: (c, s) rad/s, nan where it does not exist.
        mac: (c, s - 1) modal assurance criterion of each step, nan where there is none.
        solved: rad/s, the speeds whose equilibrium was computed where the others follow from a range; None: all.
        whirl: (c, s) rad/s, g of modes with gyroscopic coupling; None: they have none.
    """

    speeds: Array
    modes: Indices
    omega: Array
    mac: Array
    solved: Array | None = None
    whirl: Array | None = None

    def frequency(self, curve: int, speeds: Array) -> Array:
        """Hz of one curve at any speeds (rad/s), nan outside its range."""
        known, at = self.modes[curve] >= 0, np.asarray(speeds)
        x, y = self.speeds[known], self.omega[curve, known]
        g = np.zeros_like(y) if self.whirl is None else self.whirl[curve, known]
        plain = np.interp(at**2, x**2, y**2 - 2 * g * y, left=np.nan, right=np.nan)
        g = np.interp(at, x, g)
        return (g + np.sqrt(np.maximum(g**2 + plain, 0.0))) / (2 * np.pi)

    def coupled(self, plain: Sequence[Array]) -> Tracks:
        """The same curves, those of the modes with gyroscopic coupling. plain: at each station rad/s without it."""
        g = np.zeros(self.omega.shape)
        for i, omega in enumerate(plain):
            here = (self.modes[:, i] >= 0) & (self.modes[:, i] < len(omega)) & (self.omega[:, i] > 0)
            own = self.omega[here, i]
            g[here, i] = (own**2 - omega[self.modes[here, i]] ** 2) / (2 * own)
        return replace(self, whirl=g)


@dataclass(frozen=True)
class Crossing:
    """Engine order `order` meets curve `curve` (0-based) at `speed` (rad/s) and `frequency` (Hz)."""

    order: int
    curve: int
    speed: float
    frequency: float


def mac(A: Array, B: Array, weights: Array | None = None) -> Array:
    """Modal assurance criterion of two sets of shapes.

    Args:
        A: (n, 3, a). B: (n, 3, b). weights: (n,) mass or volume that belongs to each point; None: all equal.

    Returns:
        (a, b) numbers between 0 and 1: |A^H W B|^2 / ((A^H W A) (B^H W B)).
    """
    w = np.ones(len(A)) if weights is None else weights
    left = A.reshape(-1, A.shape[2])
    WB = (w[:, None, None] * B).reshape(-1, B.shape[2])
    a = np.einsum("n,nia,nia->a", w, A.conj(), A).real
    b = np.einsum("nib,nib->b", w[:, None, None] * B, B.conj()).real
    scale = np.outer(a, b)
    return np.divide(np.abs(left.conj().T @ WB) ** 2, scale, out=np.zeros_like(scale), where=scale > 0)


def track(groups: Sequence[ModalGroup], weights: Array | None = None) -> Tracks:
    """Follow modes over the speed by the MAC of their shapes.

    Args:
        groups: one a speed, speeds ascending, same mesh. weights: see `mac`.

    Returns:
        The curves in the order of their first mode. Without shapes in the groups mode j is joined to mode j.
        At every step the assignment with the largest sum of MAC is taken; where even that stays below `LINK`
        the curve ends and a new one begins.
    """
    modes, omega, macs = follow(groups, weights)
    return Tracks(np.array([g.speed for g in groups]), modes, omega, macs)


def follow(groups: Sequence[ModalGroup], weights: Array | None = None) -> tuple[Indices, Array, Array]:
    """Join modes from group to group, whatever their parameter (speed, nodal diameter); see `track`.

    Returns:
        `modes`, `omega` and `mac` as in `Tracks`.
    """
    links = [_link(a, b, weights) for a, b in zip(groups[:-1], groups[1:], strict=True)]
    return _joined([g.omega for g in groups], links)


def _joined(found: Sequence[Array], links: Sequence[tuple[Indices, Array]]) -> tuple[Indices, Array, Array]:
    """`modes`, `omega` and `mac` of curves from the frequencies of every station and the links between them."""
    s = len(found)
    rows: list[list[int]] = [[j] + [-1] * (s - 1) for j in range(len(found[0]))]
    macs: list[list[float]] = [[np.nan] * (s - 1) for _ in rows]
    for step, (partner, values) in enumerate(links):
        at = {row[step]: number for number, row in enumerate(rows) if row[step] >= 0}
        for mode in range(len(found[step + 1])):
            before = int(partner[mode])
            if before < 0:
                rows.append([-1] * (step + 1) + [mode] + [-1] * (s - step - 2))
                macs.append([np.nan] * (s - 1))
            else:
                rows[at[before]][step + 1] = mode
                macs[at[before]][step] = float(values[mode])
    modes = np.array(rows, dtype=np.int64).reshape(len(rows), s)
    omega = np.full(modes.shape, np.nan)
    for i, here_omega in enumerate(found):
        here = modes[:, i] >= 0
        omega[here, i] = here_omega[modes[here, i]]
    return modes, omega, np.array(macs, dtype=float).reshape(len(rows), s - 1)


def _link(a: ModalGroup, b: ModalGroup, weights: Array | None) -> tuple[Indices, Array]:
    """For each mode of b: the mode of a it continues (-1: none), and their MAC."""
    if not (len(a.phi) and len(b.phi)):
        partner = np.full(b.n_modes, -1, dtype=np.int64)
        common = min(a.n_modes, b.n_modes)
        partner[:common] = np.arange(common)
        return partner, np.full(b.n_modes, np.nan)
    return _assigned(mac(a.phi, b.phi, weights))


def _assigned(table: Array) -> tuple[Indices, Array]:
    """For each column of a table of MAC: its row (-1: none), and the MAC; the largest sum wins."""
    partner, value = np.full(table.shape[1], -1, dtype=np.int64), np.full(table.shape[1], np.nan)
    from scipy.optimize import linear_sum_assignment  # a tenth of a second, for speed ranges alone

    rows, columns = linear_sum_assignment(-table)
    good = table[rows, columns] >= LINK
    partner[columns[good]] = rows[good]
    value[columns[good]] = table[rows, columns][good]
    return partner, value


def track_range(r: SpeedRange, waves: str = "") -> Tracks:
    """Curves at the points of a speed range.

    Args:
        waves: ``forward`` or another sense of travel, with gyroscopic coupling; empty: without it.

    In its M-orthonormal coordinates the MAC with the mass as weight is the squared product of two modes, so nothing
    of the mesh's size is touched.
    """
    if waves and r.gyroscopic:
        omega, shapes = waves_over(r, r.points, waves == "forward")
    else:
        omega, shapes = frequencies_over(r, r.points)
    links = [_assigned(np.abs(a.conj().T @ b) ** 2) for a, b in zip(shapes[:-1], shapes[1:], strict=True)]
    return Tracks(r.points, *_joined(list(omega), links), r.speeds)


def track_basis(basis: ModalBasis, harmonic: int = 0) -> Tracks | None:
    """Curves of one nodal diameter of a modal file over its speed range, else over its speeds (None: fewer than two).

    The shapes are weighted by the volume that belongs to each node where the file has nodal stresses (for one
    density that is the mass), else equally.
    """
    if harmonic in basis.ranges:
        return track_range(basis.ranges[harmonic])
    groups = [g for (_, h), g in sorted(basis.groups.items()) if h == harmonic]
    if len(groups) < 2:
        return None
    return track(groups, point_weights(basis))


def track_gyroscopic(basis: ModalBasis) -> Tracks | None:
    """Curves of the modes with gyroscopic coupling of a real group, in the rotating frame; None without shapes.

    They begin at rest with the modes that have none.
    """
    groups = [g for (_, h), g in sorted(basis.groups.items()) if h == 0]
    held = [g.gyroscopic is not None or not g.speed for g in groups]
    if len(groups) < 2 or not all(held) or not any(g.speed for g in groups) or not all(len(g.phi) for g in groups):
        return None
    return track([_whirling(g) for g in groups], point_weights(basis)).coupled([g.omega for g in groups])


def parted(basis: ModalBasis) -> Tracks | None:
    """`track_gyroscopic` where the coupling changes a frequency by more than `VISIBLE`."""
    return track_gyroscopic(basis) if gyroscopic_change(basis) > VISIBLE else None


def _whirling(g: ModalGroup) -> ModalGroup:
    """The group with its gyroscopic modes in the place of its modes."""
    if g.gyroscopic is None:
        return g
    y, w = g.gyroscopic, len(g.gyroscopic.omega)
    zero = np.zeros((w, w))
    return replace(
        g, omega=np.abs(y.omega), kind=y.direction, phi=g.phi @ y.shapes, M_r=zero, K_r=zero, to_diagonal=None
    )


def gyroscopic_change(basis: ModalBasis) -> float:
    """Largest relative change of a frequency, counted in order, that gyroscopic coupling makes in the file."""
    change = 0.0
    for g in basis.groups.values():
        if g.gyroscopic is not None and len(g.gyroscopic.omega) >= len(g.omega):
            elastic = g.omega > 0
            new = np.abs(g.gyroscopic.omega[: len(g.omega)])
            change = max(change, float(np.abs(new[elastic] / g.omega[elastic] - 1).max(initial=0.0)))
    return change


def point_weights(basis: ModalBasis) -> Array | None:
    """(n,) volume that belongs to each point, m3, if the file has nodal stresses."""
    nodal = basis.groups[min(basis.groups)].stresses.get("nodes")
    return nodal.weights if nodal is not None and len(nodal.weights) == basis.mesh.n_points else None


def engine_orders(basis: ModalBasis) -> list[int]:
    """The engine orders of the body file that a modal file was made from, if it travels with it."""
    try:
        orders = json.loads(basis.provenance.get("settings", "{}"))["rotation"]["engine_orders"]
        return [k for k in orders if isinstance(k, int)]
    except (ValueError, KeyError, TypeError):
        return []


def crossings(tracks: Tracks, orders: Sequence[int]) -> list[Crossing]:
    """Where engine orders (omega = order Omega) meet the curves, ascending in speed; a curve that lies on one, as a
    whirl of a free body in the rotating frame, meets none."""
    found = []
    x = tracks.speeds
    for order in sorted({k for k in orders if k > 0}):
        for curve in range(len(tracks.modes)):
            g = tracks.omega[curve] - order * x
            g[np.abs(g) < 1e-12 * order * x] = 0.0
            for i in range(len(x) - 1):
                if np.isfinite(g[i : i + 2]).all() and g[i] * g[i + 1] <= 0 and g[i] != 0:
                    speed = (
                        _meeting(tracks, curve, order, float(x[i]), float(x[i + 1])) if g[i + 1] else float(x[i + 1])
                    )
                    found.append(Crossing(order, curve, speed, order * speed / (2 * np.pi)))
    return sorted(found, key=lambda c: (c.speed, c.order))


def _meeting(tracks: Tracks, curve: int, order: int, low: float, high: float) -> float:
    """Speed (rad/s) between two at which an engine order crosses a curve."""
    from scipy.optimize import brentq

    def apart(speed: float) -> float:
        return float(2 * np.pi * tracks.frequency(curve, np.array(speed)) - order * speed)

    return float(brentq(apart, low, high, xtol=1e-12 * high, rtol=1e-14))
