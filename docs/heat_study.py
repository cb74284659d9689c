"""Figures 6.6-4 to 6.8-3 of the book in its quantities without dimension, by the functions that their tests check.

The contact of these figures is not printed: that of tests/validation/test_sextro_ch6_forces.py and
test_sextro_ch6_heat_wear.py, a round patch of steel of 5 mm with a penetration of 0.02 a, driven at 30 m/s.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from microslip.contact.heights import Polynomial
from microslip.pictures.plots import COLOURS, plain_axes, shades
from microslip.rolling.half_space import steady_rolling
from microslip.rolling.temperature import falling, marched
from microslip.rolling.wear import depth_along, revolution, strip_depth

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "validation"))

import test_sextro_ch6_forces as forces
import test_sextro_ch6_heat_wear as heat

A, V, GRID, MIDDLE, MU = heat.A, heat.V, heat.GRID, heat.MIDDLE, 0.3
C_N0 = 2 * 2 * 1.3 * 82e9 * A / (3 * (1 - 0.3**2))  # (6.4-40)
STRESS = MU * C_N0 / A  # of mu* p_N*, (6.7-4)
WEAR = heat.I * STRESS  # I_R* (6.8-5), by which depths over a_0 are divided
CREEPAGES = (0.003, 0.006, 0.015, 0.03, 0.06)


def hot(mu_0: float) -> float:
    """K of T* = 1 (6.7-17)."""
    return 0.5 * mu_0 * C_N0 / heat.HEAT.conductivity * np.sqrt(2 * heat.HEAT.diffusivity * V / A)


def normal(axes: Any) -> None:
    """6.6-4: parabola and Hertz, and the sum over strips at four forces."""
    u, at = np.linspace(0, 2.6, 80), (forces.FORCES / forces.FORCES[1]) ** (2 / 3)
    for distribution, power, colour in (("constant", 2.0, COLOURS[0]), ("non-constant", 1.5, COLOURS[1])):
        axes.plot(u, u**power, color=colour, label=f"{distribution} distribution")
        found = forces.foundation(distribution, (1.0, 1.0)) / forces.FORCES[1]
        axes.plot(at, found, "o", color=colour, markersize=4, label=f"{distribution}, strips")
    axes.set(xlabel=r"$\Delta u^* / \Delta u^*_1$", ylabel="$F_N^* / F_{N1}^*$")


def rough(axes: Any) -> None:
    """6.6-5: over what smooth bodies carry at the same penetration."""
    s = np.linspace(1e-3, 3.0, 31)
    found, pressed = forces.rough_strips(s)
    for R, f, n, colour in zip(forces.ROUGH, found, pressed, shades(len(forces.ROUGH)), strict=True):
        axes.plot(s, f * n, color=colour, label=f"$R_Z^*$ = {R if R > 1e-5 else 0:.3g}")
    axes.set(xlabel="$|s_0^*|$", ylabel=r"$|F_W^*| / \mu F_N^*$ of smooth bodies")


def pressed(axes: Any) -> None:
    """6.6-6: 3 int R_Z f(z^2 Du / R_Z) dz / Du of Hertz' force."""
    u, z = np.linspace(1e-4, 0.04, 60), (np.arange(400) + 0.5) / 400
    for R, colour in zip(forces.ROUGH, shades(len(forces.ROUGH)), strict=True):
        share = 3 * R * np.asarray(Polynomial().volume(jnp.asarray(np.outer(u, z**2) / R))).mean(axis=1) / u
        axes.plot(u, share * u**1.5, color=colour, label=f"$R_Z^*$ = {R if R > 1e-5 else 0:.3g}")
    axes.set(xlabel=r"$\Delta u^*$", ylabel="$F_N^*$")


def over_creepages(what: str, across: bool, of: Callable[[float], np.ndarray]) -> Callable[[Any], None]:
    """of: creepage -> values over the grid, or over the strips."""

    def draw(axes: Any) -> None:
        place = GRID.y[0] / A if across else GRID.x[:, 0] / A
        for s, colour in zip(CREEPAGES, shades(len(CREEPAGES)), strict=True):
            values = of(s)
            axes.plot(place, values if across else values[:, MIDDLE], color=colour, label=f"$s_{{0x}}$ = {-s:g}")
        axes.set(xlabel="$y^*$" if across else "$x^*$", ylabel=what)

    return draw


def temperature(s: float) -> np.ndarray:
    return marched(heat.source(s), GRID.dx, heat.HEAT, 0.5, V) / hot(MU)


@cache
def falls(creepage: float, mu_0: float, gamma: float) -> tuple[float, np.ndarray]:
    """F_x / F_N, and traction along the middle over mu_0 c_N0 / a_0, with mu = mu_0 (1 - gamma T*); 0: cold."""
    vanishing = hot(mu_0) / gamma if gamma else 1e9
    share, T = heat.with_heat(creepage, mu_0, vanishing)
    n = len(T)
    grid = heat.Grid.around(1.1 * A, 1.1 * A, n, n)
    gap, mu = (grid.x**2 + grid.y**2) / (2 * heat.R), falling(T, mu_0, vanishing)
    c = steady_rolling(gap, grid, heat.STEEL, mu, approach=0.02 * A, creepages=(-creepage, 0, 0))
    return share * mu_0, c.traction[0][:, n // 2] / (mu_0 * C_N0 / A)


def hot_tractions(axes: Any) -> None:
    """6.7-4"""
    for s, colour in zip(CREEPAGES, shades(len(CREEPAGES)), strict=True):
        _, traction = falls(s, MU, 1000.0)
        axes.plot(1.1 * np.linspace(-1, 1, len(traction)), traction, color=colour, label=f"$s_{{0x}}$ = {-s:g}")
    axes.set(xlabel="$x^*$", ylabel=r"$\tau_{Wx}^*$, $\gamma_\mu$ = 1000")


def characteristic(mu_0: float, gammas: tuple[float, ...]) -> Callable[[Any], None]:
    """6.7-5 and 6.7-6"""

    def draw(axes: Any) -> None:
        s = np.array([0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.01, 0.02, 0.04, 0.06])
        for gamma, colour in zip(gammas, shades(len(gammas)), strict=True):
            force = [falls(float(x), mu_0, gamma)[0] for x in s]
            axes.plot([0, *s], [0, *force], ".-", color=colour, label=rf"$\gamma_\mu$ = {gamma:g}")
        axes.set(xlabel="$-s_{0x}$", ylabel=r"$F_{Wx} / F_N$", ylim=(0, 1.05 * mu_0))

    return draw


TURNS, ACROSS = 24, np.linspace(-2 * A, 2 * A, 81)


def turning(axes: Any, unit: str, values: np.ndarray, y: np.ndarray) -> None:
    """A map over the angle of the wheel and the width."""
    n = len(values)
    shown = axes.pcolormesh(360 / n * np.arange(n), y / A, values.T, cmap="viridis", shading="nearest")
    axes.set(xlabel=r"$\delta$ in degrees", ylabel="$y^*$")
    axes.figure.colorbar(shown, ax=axes, label=unit)


@cache
def normal_motion() -> tuple[np.ndarray, np.ndarray]:
    """(n, y) depth over I_R*, and T* at the trailing edge, under Du* = 0.02 + 0.03 sin(delta)."""
    found = [heat.penetrated(float(u) * A) for u in 0.02 + 0.03 * np.sin(2 * np.pi * np.arange(TURNS) / TURNS)]
    dx, n = 3.6 * A / 30, 30
    rows = [None if one is None else (strip_depth(one[0], dx, heat.I, V), dx, 0.0) for one in found]
    worn = revolution(lambda k: rows[k], TURNS, ACROSS) / (A * WEAR)
    place = 1.8 * A * (2 * np.arange(n) + 1 - n) / n
    T = np.zeros((TURNS, len(ACROSS)))
    for k, one in enumerate(found):
        if one is not None:
            T[k] = np.interp(ACROSS, place, marched(one[0], dx, heat.HEAT, 0.5, V).max(axis=0))
    return worn, T / hot(MU)


@cache
def lateral_motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same where the patch moves by four of its half axes, which is not printed; and the places, m."""
    n, y = 48, np.linspace(-6 * A, 6 * A, 241)
    middles = 4 * A * np.sin(2 * np.pi * np.arange(n) / n)
    depth, top = strip_depth(heat.source(0.06), GRID.dx, heat.I, V), temperature(0.06).max(axis=0)
    worn = revolution(lambda k: (depth, GRID.dy, middles[k]), n, y) / (A * WEAR)
    T = np.array([np.interp(y, GRID.y[0] + m, top, left=0.0, right=0.0) for m in middles])
    return worn, T, y


DEPTH, HOT = "$z_{RW}^* / I_R^*$", "$T^*$ at the trailing edge"
FIGURES: dict[str, Callable[[Any], None]] = {
    "6.6-4": normal,
    "6.6-5": rough,
    "6.6-6": pressed,
    "6.7-1a": over_creepages(r"$\tau_{Wx}^*$", False, lambda s: heat.rolling(s).traction[0] / STRESS),
    "6.7-1b": over_creepages("$q_H^*$", False, lambda s: heat.source(s) / (STRESS * V)),
    "6.7-3a": over_creepages("$T^*$", False, temperature),
    "6.7-3b": over_creepages(HOT, True, lambda s: temperature(s)[0]),
    "6.7-4": hot_tractions,
    "6.7-5": characteristic(MU, (0.0, 500.0, 1000.0, 2000.0)),
    "6.7-6": characteristic(0.38, (1400.0,)),
    "6.8-1a": over_creepages(DEPTH, False, lambda s: depth_along(heat.source(s), GRID.dx, heat.I, V) / (A * WEAR)),
    "6.8-1b": over_creepages(DEPTH, True, lambda s: strip_depth(heat.source(s), GRID.dx, heat.I, V) / (A * WEAR)),
    "6.8-2a": lambda axes: turning(axes, DEPTH, normal_motion()[0], ACROSS),
    "6.8-2b": lambda axes: turning(axes, HOT, normal_motion()[1], ACROSS),
    "6.8-3a": lambda axes: turning(axes, DEPTH, lateral_motion()[0], lateral_motion()[2]),
    "6.8-3b": lambda axes: turning(axes, HOT, lateral_motion()[1], lateral_motion()[2]),
}
"""Number -> what draws it into axes. a, b: as the book has them, of 6.8-2 and 6.8-3 wear and temperature."""


def picture(fig: Any) -> Any:
    """All of them."""
    for axes, (number, draw) in zip(fig.subplots(4, 4).ravel(), FIGURES.items(), strict=True):
        plain_axes(axes)
        draw(axes)
        axes.set_title(f"Fig. {number}", fontsize=9)
        shared = number in ("6.7-1b", "6.7-3a", "6.7-3b", "6.7-4", "6.8-1a", "6.8-1b")  # that of 6.7-1a
        if axes.get_legend_handles_labels()[0] and not shared:
            axes.legend(frameon=False, fontsize=5.5, handlelength=1.0)
    return fig
