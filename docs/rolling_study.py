"""Figures 6.5-1 to 6.7-2 of the book, of a round steel patch of 5 mm: the second picture of docs/book.md.

What is not printed is chosen as in tests/validation/test_sextro_ch6_forces.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import brentq

import microslip as ms
from microslip.rolling.half_space import steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair
from microslip.rolling.strips import Distribution
from microslip.rolling.temperature import Conductor, conducted, marched

G, NU, MU, F_N, A, V = 82e9, 0.25, 0.3, 4e4, 5e-3, 30.0
HELD = MU * F_N
CIRCLE: dict[str, Any] = {"a": A, "b": A, "normal_force": F_N, "friction": MU, "shear": G, "poisson": NU}
C11, C22, C23, _ = np.asarray(ms.creep_coefficients(1.0, NU))
LINEAR = 3 * HELD / (G * A**2)
HEAT = Conductor(50.0, 7850.0, 450.0)
COLOURS = ("#0b4f9c", "#d98410", "#5a8f3c", "#c8382c", "#7a4fa3")
BOTH: tuple[Distribution, ...] = ("constant", "non-constant")


@cache
def exact() -> tuple[np.ndarray, np.ndarray]:
    """x/a and traction over mu p_N(0) in the middle of half-spaces that carry 0.72 mu F_N."""
    g = Grid.around(1.1 * A, 1.1 * A, 55, 55)
    gap = 3 * F_N * (1 - NU) / (8 * G * A**3) * (g.x**2 + g.y**2)
    c = steady_rolling(gap, g, Pair(G, NU), MU, force=F_N, tangential=(0.72 * HELD, None))
    top = 1.5 * F_N / (np.pi * A**2)
    return g.x[:, 0] / A, c.traction[0][:, 27] / (MU * top)


def tractions(distribution: Distribution, number: str) -> Callable[[Any], None]:
    def draw(axes: Any) -> None:
        how = {"distribution": distribution, "elements": (80, 21)}
        xi = brentq(lambda x: -ms.creep_forces(x, 0, 0, **CIRCLE, **how).x[0] / HELD + 0.72, -LINEAR / C11, 0)
        t = ms.tractions(xi, 0, 0, **CIRCLE, **how)
        top = {"constant": 2.0, "non-constant": 1.5}[distribution] * F_N / (np.pi * A**2)
        axes.plot(t.x[0, 10] / A, t.traction_x[0, 10] / (MU * top), color=COLOURS[0], label=distribution)
        axes.plot(t.x[0, 10] / A, t.pressure[0, 10] / top, "--", color="0.5", label="its pressure")
        axes.plot(*exact(), ".", color=COLOURS[3], markersize=3, label="half-space")
        axes.set(title=f"Fig. {number}", xlabel="x / a", ylabel=r"$\tau^*_{Wx}$")

    return draw


def creep(axes: Any) -> None:
    s = np.linspace(0, 1.5, 46)
    for d, colour in zip(BOTH, COLOURS, strict=False):
        axes.plot(s, -ms.creep_forces(s * LINEAR / C11, 0, 0, **CIRCLE, distribution=d).x / HELD, color=colour, label=d)
    simple = [-ms.fastsim(x, 0, 0, **CIRCLE)[0].x / HELD for x in s * LINEAR / C11]
    axes.plot(s, simple, color=COLOURS[2], label="FASTSIM")
    axes.plot(s, 1 - (1 - np.minimum(s, 1)) ** 3, ":", color=COLOURS[3], label="third power")
    axes.set(title="Figs. 6.6-1, 6.6-2", xlabel="$|s_0^*|$", ylabel="$|F_W^{**}|$")


def spin(axes: Any) -> None:
    psi = np.linspace(0, 2.4, 60)
    for d, colour in zip(BOTH, COLOURS, strict=False):
        for how, line in (("book", "-"), ("kalker", ":")):
            f = ms.creep_forces(0, 0, psi * HELD / (C23 * G * A**3), **CIRCLE, distribution=d, spin=how)
            axes.plot(psi, -f.y / HELD, line, color=colour, label=d if how == "book" else f"{d}, C23")
    axes.plot(0.89, 0.619, "o", color=COLOURS[3], label="half-space")
    axes.set(title="Fig. 6.6-3", xlabel=r"$\psi^*$", ylabel="$F_{Wy}^{**}$", ylim=(0, 1.05))


def rules(axes: Any) -> None:
    n = 400
    x = (np.arange(n) - (n - 1) / 2) * 2 / n
    sources = {"even": np.ones(n), "elliptic": np.sqrt(1 - x**2)}
    unit = conducted(sources["even"][:, None], 2 * A / n, HEAT, 0.5, V).max()
    for (name, q), colour in zip(sources.items(), COLOURS, strict=False):
        for rule, line in ((conducted, "-"), (marched, ":")):
            T = rule(q[:, None], 2 * A / n, HEAT, 0.5, V)[:, 0] / unit
            axes.plot(-x, T, line, color=colour, label=name if rule is conducted else f"{name}, marched")
    axes.set(title="Fig. 6.7-2", xlabel="-x / a", ylabel="temperature")


FIGURES: dict[str, Callable[[Any], None]] = {
    "6.5-1": tractions("constant", "6.5-1"),
    "6.5-2": tractions("non-constant", "6.5-2"),
    "6.6-1": creep,
    "6.6-2": creep,
    "6.6-3": spin,
    "6.7-2": rules,
}
"""Number -> what draws it into axes."""


def picture(fig: Any, plain: Callable[[Any], None]) -> Any:
    shown = [FIGURES[number] for number in ("6.5-1", "6.5-2", "6.6-1", "6.6-3", "6.7-2")]
    every = fig.subplots(2, 3).ravel()
    every[-1].set_visible(False)
    for axes, draw in zip(every, shown, strict=False):
        plain(axes)
        draw(axes)
        axes.legend(frameon=False, fontsize=6.5)
    return fig
