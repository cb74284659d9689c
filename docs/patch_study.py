"""Figure and numbers of "Contacts between bodies": the pin of geometry/pin in its hole, by Hertz and on springs."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from microslip.contact.curved import Line, Match, apart, foundation_of_line, gap, in_hole
from microslip.contact.friction import Coulomb
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, equilibrium, grid, pressure
from microslip.contact.point import PointContact
from microslip.contact.solids import Solid

STEEL = Solid(2.1e11, 0.3)
LINE = Line(STEEL, STEEL, in_hole(6e-3, 6.1e-3), 15e-3)
STRIP = 2e-3
LOADS = (20.0, 100.0, 500.0)
MATCHES: tuple[Match, ...] = ("approach", "width")


def points(force: float, match: Match, across: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Places across the line (m) and pressures (Pa) of points on springs that are fitted at a force."""
    k = foundation_of_line(LINE, force, STRIP, match).stiffness
    places, areas = grid(LINE.length, STRIP, (1, across))
    springs = PointContact(Penalty(jnp.asarray(k * areas)), Coulomb(jnp.asarray(0.3)), jnp.asarray(k * areas))
    patch = Patch("pin", places, areas, apart(springs, gap(places, (np.inf, LINE.radius))))
    return places[:, 1], pressure(patch, equilibrium(patch, force))


def pressures(figure: Any) -> Any:
    """Pressure over the width at 100 N, and approach over force of springs that are fitted there."""
    left, right = figure.subplots(1, 2)
    x = np.linspace(-0.3e-3, 0.3e-3, 601)
    left.plot(1e3 * x, 1e-6 * LINE.pressure(100.0, x), color="k", label="Hertz")
    forces = np.linspace(0.5, 300, 200)
    right.plot(1e6 * LINE.approach(forces, STRIP), forces, color="k", label="Hertz, beyond the face")
    for match, colour in zip(MATCHES, ("#1f4e79", "#d1603d"), strict=True):
        z, p = points(100.0, match)
        left.plot(1e3 * z, 1e-6 * p, color=colour, label=f"springs, same {match}")
        k = foundation_of_line(LINE, 100.0, STRIP, match).stiffness
        delta = (forces / (4 / 3 * k * LINE.length * np.sqrt(2 * LINE.radius))) ** (2 / 3)
        right.plot(1e6 * delta, forces, color=colour, label=f"springs, same {match} at 100 N")
    left.set(xlabel="across the line in mm", ylabel="pressure in MPa", xlim=(-0.3, 0.3))
    right.set(xlabel="approach in µm", ylabel="normal force in N", ylim=(0, 300), xlim=(0, None))
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0)
        axes.legend(fontsize=8)
    return figure


def foundations() -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """What springs fitted at a load make of the other numbers, over Hertz'."""
    rows = []
    for force in LOADS:
        for match in MATCHES:
            f = foundation_of_line(LINE, force, STRIP, match)
            parts = (f"{v:.2f}" for v in (f.approach, f.width, f.peak, f.slope))
            rows.append((f"{force:g}", match, f"{f.stiffness:.3g}", *parts))
    return ("N", "same", "Pa/m", "approach", "width", "largest pressure", "stiffness"), rows
