"""How much static compliance the kept modes hold, and what that means (the truncation check of Sextro 2.4).

Share of one coordinate: sum_j T_j^2 / omega_j^2 over the kept modes, divided by the static compliance. A force on
one contact alone bends the whole body, which a few modes hold; two neighbours that press a shroud from both sides
squeeze it, which eigenmodes hardly hold at all. Both are examined, because a stuck contact feels the second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import CENTRIFUGAL, Array, ModalGroup
from .coordinates import compliance_row

ROUNDING = 1e-8
"""Share of the static compliance below which a basis holds all of it: slender bodies round off by as much."""


@dataclass(frozen=True)
class Coordinate:
    """One row of the truncation check.

    Attributes:
        label: ``right u_n``, ``magnet force`` or ``right + left squeezed``.
        kind: ``translation``, ``rotation``, ``squeeze``, ``excitation`` or ``monitor``.
        unit: of the compliance, e.g. ``m/N``.
        static, modal: compliance of the full model, and the part all kept modes hold.
        shares: (m,) part of `static` that the first 1, 2, ... m modes hold, 0 to 1.
    """

    label: str
    kind: str
    unit: str
    static: float
    modal: float
    shares: Array

    @property
    def share(self) -> float:
        """Part of the static compliance that all kept modes hold, all of it where the rest is rounding."""
        return 1.0 if not self.residual else float(self.shares[-1]) if len(self.shares) else 0.0

    @property
    def residual(self) -> float:
        """What the modes leave out, in `unit`; zero where that is rounding."""
        left = self.static - self.modal
        return left if left > ROUNDING * self.static else 0.0

    def modes_for(self, share: float) -> int | None:
        """Smallest number of modes that holds `share`, or None if the kept ones do not."""
        enough = np.flatnonzero(self.shares >= share)
        return int(enough[0]) + 1 if len(enough) else None


@dataclass(frozen=True)
class Verdict:
    """The truncation check of one group: its coordinates, one plain sentence, and what else should be known."""

    coordinates: tuple[Coordinate, ...]
    sentence: str
    messages: tuple[str, ...]


def verdict(group: ModalGroup, has_residual: bool = False, sectors: int = 1) -> Verdict:
    """Examine a group's static compliance.

    Args:
        group: in its own modes, real or complex. beside: whether the file holds the rest for the solver to add.
            sectors: of a ring, else 1.

    Returns:
        One `Coordinate` per interface, excitation and monitor row, one more for each pair of interfaces of this
        body that face each other round the ring, the sentence and the messages.
    """
    found = coordinates(group, sectors)
    return Verdict(found, _sentence(found, group.n_modes, has_residual), _messages(found, sectors))


def coordinates(group: ModalGroup, sectors: int = 1) -> tuple[Coordinate, ...]:
    """The rows of the check; see `verdict`."""
    labels = group.compliance.labels
    static = group.compliance.static
    T = np.array([compliance_row(group, label) for label in labels]).reshape(len(labels), group.n_modes)
    found = [
        _coordinate(group, *describe(group, label), np.eye(len(labels))[i], static, T) for i, label in enumerate(labels)
    ]
    for a, b in ring_pairs(group):
        pick, words = closing(group, a, b, sectors), "squeezed" if sectors == 1 else "across the gap"
        found.append(_coordinate(group, f"{a} + {b} {words}", "squeeze", "m/N", pick, static, T))
    return tuple(found)


def closing(group: ModalGroup, a: str, b: str, sectors: int = 1) -> Array:
    """(r,) weights p so that p @ u closes the gap at the contacts a and b; p @ C @ conj(p) is its compliance.

    A body between two neighbours: both outward normal motions, equal forces press from both sides. A ring of N bodies
    at nodal diameter k: b of the next sector moves as exp(2 pi i k / N) times b of this one, in frames that turn
    along, so the gap between a and the neighbour's b closes by u_n(a) + exp(2 pi i k / N) u_n(b).
    """
    labels = group.compliance.labels
    turn = group.interfaces[a].sector_shift * group.harmonic * 2 * np.pi / sectors if sectors > 1 else 0.0
    phase = np.exp(1j * turn) if 2 * group.harmonic % sectors and sectors > 1 else np.cos(turn).round()
    weights = {f"interface:{a}:u_n": 1.0, f"interface:{b}:u_n": phase}
    return np.array([weights.get(label, 0.0) for label in labels])


def _coordinate(
    group: ModalGroup, label: str, kind: str, unit: str, pick: Array, static: Array, T: Array
) -> Coordinate:
    omega = np.where(group.omega > 0, group.omega, np.inf)
    parts = np.cumsum(np.abs(pick @ T / omega) ** 2)
    whole = float((pick @ static @ pick.conj()).real)
    return Coordinate(label, kind, unit, whole, float(parts[-1]), parts / whole if whole > 0 else np.ones_like(parts))


def describe(group: ModalGroup, label: str) -> tuple[str, str, str]:
    """Plain label, kind and unit of a compliance row."""
    kind, name, row = label.split(":", 2)
    if kind == "interface":
        turns, kinds = row.startswith("phi"), {"u": "translation", "p": "rotation", "c": "shape"}
        return f"{name} {row}", kinds[row[0]], "rad/(N m)" if turns else "m/N"
    unit = (group.excitations if kind == "excitation" else group.monitors)[name].unit
    units = {"Pa": "m3/Pa", CENTRIFUGAL: "J s4", "rad": "rad/(N m)"}  # work per square of the load
    return f"{name} {row}", kind, units.get(unit, "m/N")


def ring_pairs(group: ModalGroup) -> list[tuple[str, str]]:
    """Left and right contacts of this body that name each other as partner, each pair once.

    Bolted patches that face each other belong to two bodies; pressing them squeezes nothing.
    """
    found = []
    for name, item in group.interfaces.items():
        facing = group.interfaces.get(item.partner)
        known = all(f"interface:{n}:u_n" in group.compliance.labels for n in (name, item.partner))
        mutual = facing is not None and facing.role == "left" and facing.partner == name
        if item.role == "right" and mutual and known:
            found.append((name, item.partner))
    return found


def percent(share: float) -> str:
    """A share as text that never rounds an incomplete one up to 100 %."""
    value = 100 * share
    if value >= 99:
        return f"{min(np.floor(value * 1000) / 1000, 100):g} %"
    return f"{value:.1f} %" if value >= 0.1 or value <= 0 else f"{value:.1g} %"


def _sentence(found: tuple[Coordinate, ...], count: int, has_residual: bool) -> str:
    """How many modes are enough, or that eigenmodes cannot hold the compliance: one sentence."""
    single = [c for c in found if c.kind == "translation"]
    what = "a force on one contact"
    if not single:
        single = [c for c in found if c.kind in ("excitation", "monitor")]
        what = "a force at an excitation or monitor"
    if not single:
        return "The body has no interface, excitation or monitor, so there is no compliance to check."
    held, good = _held(single, count, what)
    outlook = _SUPPLIED if has_residual else _OUTLOOK
    squeezed = [c for c in found if c.kind == "squeeze" and c.share < 0.9]
    if not squeezed:
        return held + ("." if good else f"; {outlook}.")
    c = min(squeezed, key=lambda c: c.share)
    return (
        f"{held}, {'but' if good else 'and'} eigenmodes cannot hold what a squeeze between both neighbours takes "
        f"({percent(c.share)} of {c.static:.3g} m/N held): {outlook}."
    )


_SUPPLIED = "the solver must add what stands beside the modes in the file"
_OUTLOOK = "put the residual compliance into the contact law or use a basis with static modes"


def _held(single: list[Coordinate], count: int, what: str) -> tuple[str, bool]:
    worst = min(single, key=lambda c: c.share)
    for share, text in ((0.99, "enough"), (0.9, "just enough")):
        needed = [c.modes_for(share) for c in single]
        if all(needed):
            most = max(n or 0 for n in needed)
            return f"{most} of {count} modes are {text} for {what}: they hold {100 * share:g} % of its compliance", True
    late = worst.share - float(worst.shares[max(count // 2 - 1, 0)])
    trend = f"the second half of the modes added {percent(late)}"
    return f"{count} modes are not enough: they hold {percent(worst.share)} at {worst.label} ({trend})", False


def _messages(found: tuple[Coordinate, ...], sectors: int) -> tuple[str, ...]:
    out = []
    turning = [c for c in found if c.kind == "rotation"]
    if turning and (worst := min(turning, key=lambda c: c.share)).share < 0.9:
        out.append(f"Turning a contact patch is held less well: {percent(worst.share)} for {worst.label}.")
    for c in found:
        if c.kind == "squeeze" and c.residual > 0 and sectors == 1:
            out.append(
                f"With equal forces pressed on both contacts ({c.label.removesuffix(' squeezed')}) the body yields "
                f"{c.static:.3g} m/N, a spring of {1 / c.static:.3g} N/m; the modes leave out {c.residual:.3g} m/N."
            )
    single = [c for c in found if c.kind == "translation"]
    if single and (worst := max(single, key=lambda c: c.residual)).residual > 0:
        spring = 1 / worst.residual
        out.append(
            f"What the modes leave out acts as a spring in series with the contact, {spring:.3g} N/m at its softest "
            f"({worst.label}): a contact law stiffer than about {0.1 * spring:.2g} N/m needs it, a softer one errs "
            "by less than 10 %."
        )
    return tuple(out)
