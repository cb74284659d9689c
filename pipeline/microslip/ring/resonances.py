"""Families of modes over the nodal diameters, and the engine orders that really excite them.

A force that stands in space excites a mode of the ring only if it has the mode's frequency and the mode's shape:
e Omega = omega, and e must alias onto the mode's nodal diameter (`ring.aliased`). A Campbell diagram alone shows the
first condition; both together are the interference diagram, known as SAFE (Singh's Advanced Frequency Evaluation,
17th Turbomachinery Symposium, 1988) and as ZZENF (zig-zag-shaped excitation line in the nodal diameters versus
frequency diagram; Wildheim, J. Appl. Mech. 46 (1979) 878).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, Indices, ModalBasis, ModalGroup
from ..files.tables import rows_csv
from ..linalg.gyroscopic import stability_sentence
from ..modal.campbell import Tracks, crossings, follow, point_weights, track_basis, track_range
from ..reduced.coordinates import in_modes
from ..units import to_rpm
from .expansion import BACKWARD, FORWARD, STANDING, aliased


@dataclass(frozen=True)
class Families:
    """Modes joined over the nodal diameters at the lowest speed, and followed from there to another speed.

    Attributes:
        speed: rad/s. harmonics: (K,) nodal diameters, ascending.
        modes: (c, K) mode number (0-based) of each family at each nodal diameter, -1 where it does not exist.
        omega: (c, K) rad/s, nan where it does not exist. mac: (c, K - 1) of each step at the lowest speed, nan where
            there is none.
    """

    speed: float
    harmonics: Indices
    modes: Indices
    omega: Array
    mac: Array

    def of(self, harmonic: int, mode: int) -> int:
        """Number (0-based) of the family to which a mode of a nodal diameter belongs, -1 if it belongs to none."""
        column = int(np.flatnonzero(self.harmonics == harmonic)[0])
        found = np.flatnonzero(self.modes[:, column] == mode)
        return int(found[0]) if len(found) else -1


@dataclass(frozen=True)
class Resonance:
    """Engine order `order` meets a mode that it excites.

    Attributes:
        order: e. nodal_diameter: k onto which it aliases. direction: of the wave on the rotor, see `ring.aliased`.
        family: 1-based. mode: 1-based, at the lowest speed of its curve. speed: rad/s. frequency: Hz.
    """

    order: int
    nodal_diameter: int
    direction: str
    family: int
    mode: int
    speed: float
    frequency: float


@dataclass(frozen=True)
class Margin:
    """How far a mode is from an engine order that excites it, at one speed.

    Attributes:
        order, nodal_diameter, direction, family: see `Resonance`. frequency: of the mode, Hz. excitation: e times
            the speed, Hz.
    """

    order: int
    nodal_diameter: int
    direction: str
    family: int
    frequency: float
    excitation: float

    @property
    def relative(self) -> float:
        """(frequency - excitation) / excitation."""
        return self.frequency / self.excitation - 1


def speeds_of(basis: ModalBasis) -> list[int]:
    """Indices of the speeds of a modal file."""
    return sorted({s for s, _ in basis.groups})


def harmonics_of(basis: ModalBasis) -> list[int]:
    """Nodal diameters of a modal file."""
    return sorted({k for _, k in basis.groups})


def eigenmodes(group: ModalGroup) -> ModalGroup:
    """The group cut to its eigenmodes, which come first: frequencies and shapes without what a reduction adds.

    Of a body reduced to other coordinates (Craig-Bampton) the modes up to the certified bound remain.
    """
    if group.to_diagonal is not None or "reduced" in group.kind:
        group = in_modes(group)
        count = int((group.frequency <= group.checks.get("upper_shift_hz", np.inf)).sum())
    else:
        count = sum(kind in ("normal", "rigid") for kind in group.kind)
    if count == group.n_modes:
        return group
    return replace(
        group,
        omega=group.omega[:count],
        kind=group.kind[:count],
        damping_ratio=group.damping_ratio[:count],
        phi=group.phi[:, :, :count],
    )


def travelling(group: ModalGroup, direction: str) -> ModalGroup:
    """The eigenmodes of one sense of travel, with gyroscopic coupling where the group holds it.

    The coupling splits the two waves of 0 < k < N/2: positive omega of `GyroscopicModes` run backward, negative ones
    forward. Standing waves, and groups without the coupling, keep their frequencies for both.
    """
    plain, g = eigenmodes(group), group.gyroscopic
    chosen = _waves(group, direction, plain.n_modes)
    if g is None or chosen is None:
        return plain
    phi = group.phi @ g.shapes[:, chosen] if len(group.phi) else plain.phi
    return replace(plain, omega=np.abs(g.omega[chosen]), phi=phi)


def _waves(group: ModalGroup, direction: str, count: int) -> Indices | None:
    """(count,) which of the modes with gyroscopic coupling run this way, the lowest; None: not so many are known.

    Elastic modes run as often forward as backward, the rigid motions of a free ring do not (a whirl at Omega runs
    backward): as many stand before the elastic ones as there are at rest, the last of them repeated or left out.
    """
    g = group.gyroscopic
    if g is None or not g.stable:
        return None
    chosen = np.flatnonzero(g.omega < 0 if direction == FORWARD else g.omega >= 0)
    chosen = chosen[np.argsort(np.abs(g.omega[chosen]), kind="stable")]
    rigid = int((group.omega == 0).sum())
    if rigid and (lead := len(chosen) - (len(group.omega) - rigid)) > 0:
        chosen = np.concatenate([chosen[np.minimum(np.arange(rigid), lead - 1)], chosen[lead:]])
    return chosen[:count] if len(chosen) >= count else None


def waves_of(group: ModalGroup) -> dict[str, tuple[Array, Array]]:
    """Direction -> frequencies (m,) in Hz with gyroscopic coupling, and how much too high they are at most, (m,).

    Both waves of 0 < k < N/2, else ``standing``. Empty where the group holds no coupling, or where a mode grows.
    """
    g, count = group.gyroscopic, eigenmodes(group).n_modes
    if g is None or not g.stable:
        return {}
    ways = (BACKWARD, FORWARD) if (g.omega < 0).any() else (STANDING,)
    found = {way: _waves(group, way, count) for way in ways}
    return {way: (g.frequency[w], g.error[w]) for way, w in found.items() if w is not None}


def whirl_sentence(groups: Sequence[ModalGroup]) -> str | None:
    """Stability of a ring from its nodal diameters at one speed; None: it holds no gyroscopic coupling."""
    found = [(g, y) for g in groups if (y := g.gyroscopic) is not None]
    lost = [f"nodal diameter {g.harmonic}: {stability_sentence(y)}" for g, y in found if not y.stable]
    return " ".join(lost) or next((stability_sentence(y) for _, y in found), None)


def whirl_bounds(groups: Sequence[ModalGroup]) -> Array:
    """(m,) how much too high the frequencies of `waves_of` are at most, over all waves of a speed; NaN: not known."""
    errors = [e for g in groups for _, e in waves_of(g).values()]
    known = np.full((len(errors), max((len(e) for e in errors), default=0)), -1.0)
    for row, e in zip(known, errors, strict=True):
        row[: len(e)] = np.nan_to_num(e, nan=-1.0)
    worst = known.max(axis=0, initial=-1.0)
    return np.where(worst < 0, np.nan, worst)


def families(basis: ModalBasis, speed: int = 0) -> Families:
    """Join the modes of neighbouring nodal diameters by the MAC of their shapes.

    They are joined once, at the lowest speed, so that a family keeps its number; at another speed (an index) each
    of their modes is the one that the curve over the speed leads to. Without shapes in the file mode j is joined to
    mode j. The families are in the order of their first mode.
    """
    harmonics = np.array(harmonics_of(basis))
    first = speeds_of(basis)[0]
    groups = {key: eigenmodes(g) for key, g in sorted(basis.groups.items())}
    modes, omega, mac = follow([groups[first, k] for k in harmonics.tolist()], point_weights(basis))
    at = speeds_of(basis).index(speed)
    if at:
        modes, omega = modes.copy(), np.full_like(omega, np.nan)
        stations = replace(basis, ranges={})
        for column, k in enumerate(harmonics.tolist()):
            curves = _tracks_of(stations, k, "")
            assert curves is not None
            modes[:, column] = _carried(curves, modes[:, column], at)
            here = modes[:, column] >= 0
            omega[here, column] = basis.groups[speed, k].omega[modes[here, column]]
    return Families(basis.groups[speed, int(harmonics[0])].speed, harmonics, modes, omega, mac)


def _carried(curves: Tracks, modes: Indices, at: int) -> Indices:
    """The modes at station `at` of the curves that begin as `modes` (-1: none)."""
    table = np.full(int(curves.modes.max()) + 2, -1, dtype=np.int64)  # the last entry, -1, is for none
    begun = curves.modes[:, 0] >= 0
    table[curves.modes[begun, 0]] = curves.modes[begun, at]
    return table[modes]


def tracks(basis: ModalBasis) -> dict[int, Tracks]:
    """Curves over the speed of each nodal diameter, without gyroscopic coupling; empty with fewer than two speeds."""
    return {k: t for k in harmonics_of(basis) if (t := _tracks_of(basis, k, "")) is not None}


def wave_tracks(basis: ModalBasis, nodal_diameter: int, direction: str) -> Tracks | None:
    """Curves of the waves of one nodal diameter and sense of travel; None where the file does not hold them."""
    return _tracks_of(basis, nodal_diameter, direction) if nodal_diameter in harmonics_of(basis) else None


def _tracks_of(basis: ModalBasis, harmonic: int, direction: str) -> Tracks | None:
    """Curves of one nodal diameter over the speed range where there is one, else over the speeds; or None."""
    if harmonic in basis.ranges:
        return track_range(basis.ranges[harmonic], direction)
    groups = {
        key: travelling(g, direction) if direction else eigenmodes(g)
        for key, g in basis.groups.items()
        if key[1] == harmonic
    }
    found = track_basis(replace(basis, groups=groups), harmonic) if groups else None
    if found is None or not direction:
        return found
    return found.coupled([eigenmodes(basis.groups[key]).omega for key in sorted(groups)])


def resonances(basis: ModalBasis, orders: Iterable[int]) -> list[Resonance]:
    """Where engine orders meet modes of the nodal diameter they excite, ascending in speed.

    Gyroscopic coupling is in the frequencies where the file holds it; a forward wave and a backward wave of one nodal
    diameter then differ.

    Args:
        basis: at two speeds or more. orders: engine orders; those that alias onto a nodal diameter that the file
            does not hold find nothing (`unanswered`).
    """
    joined, out = families(basis), []
    wanted = {e: aliased(e, basis.sectors) for e in sorted({e for e in orders if e > 0})}
    curves = {wave: _tracks_of(basis, *wave) for wave in set(wanted.values())}
    for order, (k, direction) in wanted.items():
        found = curves[k, direction]
        if found is None:
            continue
        for c in crossings(found, [order]):
            row = found.modes[c.curve]
            mode = int(row[row >= 0][0])
            family = joined.of(k, mode) + 1 if row[0] >= 0 else 0
            out.append(Resonance(order, k, direction, family, mode + 1, c.speed, c.frequency))
    return sorted(out, key=lambda r: (r.speed, r.order))


def unanswered(basis: ModalBasis, orders: Iterable[int]) -> list[int]:
    """Engine orders whose nodal diameter the file does not hold."""
    held = harmonics_of(basis)
    return sorted({e for e in orders if e > 0 and aliased(e, basis.sectors)[0] not in held})


def margins(basis: ModalBasis, speed: int, orders: Iterable[int], within: float = np.inf) -> list[Margin]:
    """Distances of modes from the engine orders that excite them, at one speed (an index), nearest first.

    Args:
        within: only modes whose frequency differs by less than this part of the excitation's.
    """
    joined, out = families(basis, speed), []
    turns = joined.speed / (2 * np.pi)
    for order in sorted({e for e in orders if e > 0}) if turns else []:
        k, direction = aliased(order, basis.sectors)
        group = basis.groups.get((speed, k))
        for j, f in enumerate(travelling(group, direction).frequency) if group is not None else []:
            out.append(Margin(order, k, direction, joined.of(k, j) + 1, float(f), order * turns))
    return sorted((m for m in out if abs(m.relative) < within), key=lambda m: abs(m.relative))


def zigzag(sectors: int, turns: float, top: float) -> tuple[Array, Array]:
    """Corners of the excitation line: (c,) nodal diameters and (c,) Hz, from (0, 0) up to the frequency `top`.

    The line f = e turns, with e reflected at 0 and N/2 as `ring.aliased` does; legs that rise to the right are
    backward waves, those that rise to the left forward ones.

    Args:
        turns: revolutions per second.
    """
    legs = int(np.ceil(top / (turns * sectors / 2))) if turns > 0 else 0
    corners = np.arange(legs + 1)
    return np.where(corners % 2, sectors / 2, 0.0), corners * turns * sectors / 2


HEAD = ("rpm", "Hz", "engine order", "nodal diameter", "wave on the rotor", "family", "mode")


def rows(found: Sequence[Resonance]) -> list[tuple[str, ...]]:
    """Cells under `HEAD`."""
    return [
        (
            f"{to_rpm(r.speed):.1f}", f"{r.frequency:.2f}", str(r.order), str(r.nodal_diameter), r.direction,
            str(r.family or ""), str(r.mode),
        )
        for r in found
    ]  # fmt: skip


def resonance_csv(found: Sequence[Resonance]) -> str:
    """The table as comma-separated text, with a head."""
    return rows_csv(HEAD, rows(found))


def family_ranges(found: Families) -> Mapping[int, tuple[float, float]]:
    """Family (0-based) -> lowest and highest frequency over the nodal diameters, Hz."""
    f = found.omega / (2 * np.pi)
    return {c: (float(np.nanmin(f[c])), float(np.nanmax(f[c]))) for c in range(len(f))}
