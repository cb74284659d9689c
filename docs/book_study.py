"""Figures and numbers of docs/book_mode.md: complex stiffness of the book's contact (Sextro, Figs. 5.2-4 to 5.2-7)."""

from __future__ import annotations

import time
from typing import Any

import jax.numpy as jnp
import numpy as np

from microslip.case.comparison import Pair
from microslip.contact.curves import curve
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Linear, Polynomial
from microslip.contact.normal import Normal, Rough, measured
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.harmonic_balance import book, orbits

MU, C_N0, C_R0, R_Z = 0.2, 840e6, 80e6, 7.5e-6  # section 5.3
B0, H0, COUNTS = 0.072, 0.005, (72, 5)


def contact(strips: int = 0) -> book.BookPatch:
    """The shroud contact of section 5.3."""
    n = COUNTS[0] * COUNTS[1]
    normal = Rough(jnp.asarray(C_N0 / n), jnp.asarray(R_Z), Polynomial())
    law = PointContact(normal, Coulomb(jnp.asarray(MU)), jnp.asarray(C_R0 / n))
    return book.book_patch(Patch("right", *grid(B0, H0, COUNTS), law), strips)


FIGURES = (
    ("5.2-4", r"$\hat K_x^*$", r"$\hat u_x^*$", 0, C_N0, R_Z, 4.0),
    ("5.2-5", r"$\hat K_{y,z}^*$", r"$\hat u_{y,z}^*$", 1, C_R0, None, 4.0),
    ("5.2-6", r"$\hat K_{\varphi x}^*$", r"$\hat\varphi_x^*$", 3, C_R0 * B0**2, None, 12.0),
    ("5.2-7", r"$\hat K_{\varphi y,z}^*$", r"$\hat\varphi_{y,z}^*$", 4, C_N0 * H0**2, R_Z / H0, 12.0),
)  # fmt: skip
"""Number, ordinate, abscissa, coordinate, unit of the stiffness (5.2-37 to 5.2-41), unit of the amplitude, its end."""


def stiffness(one: book.BookPatch, coordinate: int, unit: float, amplitude: np.ndarray) -> np.ndarray:
    """(f,) K* of one coordinate that moves alone with amplitudes (f,) in SI, about u_G* = 1."""
    u = np.zeros((len(amplitude), 6, 3))
    u[:, 0, 0], u[:, coordinate, 1] = R_Z, amplitude
    return one.stiffness(u)[:, coordinate, coordinate] / unit


def figures(figure: Any) -> Any:
    """The four figures, without and with the microslip of the rough surface."""
    slips = MU * float(Polynomial().volume(jnp.asarray(1.0))) * C_N0 * R_Z / C_R0
    panels = figure.subplots(2, 2)
    alike, microslip = "all of the area pressed alike", "microslip of the rough surface (5.2-33)"
    ways = ((contact(), "-", alike), (contact(24), "--", microslip))
    for axes, (number, ordinate, abscissa, coordinate, unit, length, end) in zip(panels.ravel(), FIGURES, strict=True):
        x = np.linspace(1e-3, end, 160)
        scale = length or slips / (B0 if coordinate == 3 else 1.0)
        for one, style, label in ways:
            K = stiffness(one, coordinate, unit, x * scale)
            axes.plot(x, K.real, style, color="#1f4e79", label=f"stiffness: {label}")
            axes.plot(x, K.imag, style, color="#d1603d", label=f"damping: {label}")
        axes.set(xlabel=abscissa, ylabel=ordinate, xlim=(0, end), title=f"Fig. {number}")
        axes.set_ylim(bottom=-0.01 * axes.get_ylim()[1])
        axes.grid(alpha=0.3)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
    return figure


LAWS: tuple[tuple[str, Normal], ...] = (
    ("rough, book's heights (3.3-24)", Rough(jnp.asarray(C_N0), jnp.asarray(R_Z), Polynomial())),
    ("rough, equally frequent heights", Rough(jnp.asarray(C_N0), jnp.asarray(R_Z), Linear())),
    ("a measured curve of five points", measured(curve([0, 2e-6, 5e-6, 9e-6, 14e-6], [0, 20, 240, 900, 2100]))),
)


def errors() -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """What the tables know of their errors."""
    rows = []
    for name, table in (("orbits", orbits.orbits()[1]), *((n, book.swings(law)[1]) for n, law in LAWS)):
        assert table is not None
        nodes = table.arrays["coefficients"].shape[-1] - 2
        rows.append((name, f"{nodes} x {nodes}", str(table.held_out), f"{table.error:.1e}", f"{table.typical:.1e}"))
    return ("table", "nodes", "held-out places", "largest error", "99 of 100 below"), rows


def compared(pairs: list[Pair]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Resonances of a case in both modes."""
    rows = []
    for p in pairs:
        cells = [f"{x[0]:.1f} Hz, {1e6 * x[1]:.3g} µm" if x else "none" for x in (p.marched, p.book)]
        apart = p.differences()
        more = ["", ""] if apart is None else [f"{100 * x:+.1f} %" for x in apart]
        rows.append((f"{p.normal_force:g} N", *cells, *more))
    return ("normal force", "marched, H = 3", "book", "frequency", "amplitude"), rows


def seconds(one: book.BookPatch, count: int) -> tuple[float, float]:
    """Best of 50: force alone, and with its derivative, of equal contacts; s."""
    u = np.zeros((count, 6, 3))
    u[:, :3, 1:], u[:, 3:, 1:], u[:, 0, 0] = 2e-6, 3e-5, R_Z
    found = []
    for run in (one.force, one.forces):
        run(u)
        spent = []
        for _ in range(50):
            began = time.perf_counter()
            run(u)
            spent.append(time.perf_counter() - began)
        found.append(min(spent))
    return found[0], found[1]
