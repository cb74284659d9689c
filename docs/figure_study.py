"""Figures of the book that a formula draws and that no other page or command shows: the picture of docs/book.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from microslip.contact.friction import Coulomb
from microslip.contact.heights import Gaussian, Polynomial
from microslip.contact.layer import modal_stiffness
from microslip.contact.normal import Greenwood, Potential, Rough
from microslip.contact.patch import Patch, grid, pressing
from microslip.contact.point import PointContact
from microslip.mistuning import weibull

COLOURS = ("#0b4f9c", "#d98410", "#5a8f3c", "#c8382c", "#7a4fa3")


def modes(axes: Any) -> None:
    m = np.arange(1, 31)
    axes.semilogy(m, [100 * (modal_stiffness(int(n)) - 1) for n in m], ".", color=COLOURS[0])
    axes.set(title="Fig. 3.2-1", xlabel="modes", ylabel="modal stiffness too large by, %")


def laws(axes: Any) -> None:
    u = np.linspace(0, 1, 101)
    axes.plot(u, Greenwood(1.0, 0.25, 1.0).force(u), color=COLOURS[0], label="exponential")
    for k, colour in zip((1.0, 2.0, 3.0), COLOURS[1:], strict=False):
        axes.plot(u, Potential(1.0, 1.0, k).force(u), color=colour, label=f"k = {k:g}")
    axes.set(title="Fig. 3.3-1", xlabel="$u_N / u_{NS}$", ylabel="$F_N / F_{NS}$")


def densities(axes: Any) -> None:
    x = jnp.linspace(-0.2, 1.2, 281)
    for heights, name, colour in ((Polynomial(), "(3.3-6)", COLOURS[0]), (Gaussian(), "Gaussian", COLOURS[1])):
        axes.plot(x, jax.vmap(jax.grad(heights.area))(x), color=colour, label=name)
    axes.set(title="Fig. 3.3-5", xlabel="$x^*$", ylabel=r"$\Delta p^*$")


def pressures(axes: Any) -> None:
    x = np.linspace(0, 1, 201)
    share = np.asarray(Polynomial().area(x))
    for u, colour in zip((0.25, 0.5, 0.75, 1.0, 1.25), COLOURS, strict=True):
        axes.plot(share, np.maximum(u - x, 0), color=colour, label=f"u* = {u:g}")
    axes.set(title="Fig. 3.3-7", xlabel="$z^*$", ylabel="$p_N^*$")


def turned(n: int, angle: np.ndarray) -> np.ndarray:
    """(2, f) F_N* and M_y* of n elements along z at u_0x* = 0.5 and angles phi_0y* (5.2-5 to 5.2-8)."""
    law = PointContact(
        Rough(jnp.asarray(1 / n), jnp.asarray(1.0), Polynomial()), Coulomb(jnp.asarray(0.0)), jnp.ones(())
    )
    patch = Patch("face", *grid(1.0, 1.0, (1, n)), law)
    return np.array([pressing(patch, np.array([0.5, 0, 0, 0, phi, 0]))[[0, 4]] for phi in angle]).T


def discretisation(n: int = 8) -> np.ndarray:
    """(2,) largest relative difference of F_N* and M_y* of n elements from those of 1024, in the figure."""
    angle = np.linspace(0, 4, 41)[1:]  # without an angle there is no moment
    return np.abs(turned(n, angle) / turned(1024, angle) - 1).max(axis=1)


def tilted(row: int) -> Callable[[Any], None]:
    def draw(axes: Any) -> None:
        angle = np.linspace(0, 4, 41)
        for n, colour in zip((1, 2, 4, 8, 1024), COLOURS, strict=True):
            axes.plot(angle, turned(n, angle)[row], color=colour, label=f"$n_z$ = {n}")
        axes.set(title="Fig. 5.2-2", xlabel=r"$\varphi_{0y}^*$", ylabel=("$F_N^*$", "$M_y^*$")[row])

    return draw


def spread(axes: Any) -> None:
    w = np.linspace(0.01, 3, 300)
    for k, colour in zip((0.5, 1.0, 2.0, 4.0), COLOURS, strict=False):
        density = np.gradient(weibull.distribution(w, 1.0, k), w)
        axes.plot(w, density, color=colour, label=f"k = {k:g}")
    axes.set(title="Fig. 5.6-1", xlabel="w*", ylabel="density", ylim=(0, 1.5))


def exponents(axes: Any) -> None:
    s = np.geomspace(0.1, 2, 100)
    axes.semilogy(s, weibull.exponent(s), color=COLOURS[0])
    axes.plot([1, 0.523], [1, 2], "o", color=COLOURS[3], label="printed")
    axes.set(title="Fig. 5.6-2", xlabel="s", ylabel="k")


FIGURES: dict[str, Callable[[Any], None]] = {
    "3.2-1": modes, "3.3-1": laws, "3.3-5": densities, "3.3-7": pressures, "5.2-2a": tilted(0), "5.2-2b": tilted(1),
    "5.6-1": spread, "5.6-2": exponents,
}  # fmt: skip
"""Number -> what draws it into axes."""


def picture(fig: Any, plain: Callable[[Any], None]) -> Any:
    for axes, draw in zip(fig.subplots(2, 4).ravel(), FIGURES.values(), strict=True):
        plain(axes)
        draw(axes)
        if draw is not modes:
            axes.legend(frameon=False, fontsize=7)
    return fig
