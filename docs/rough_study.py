"""Rough contacts in three pictures and two tables: the laws of section 3.3 and 3.4, a profile's own law, wear."""

from __future__ import annotations

from typing import Any

import numpy as np

from microslip.contact.heights import Cut, Exponential, Gaussian, Heights, Linear, Polynomial
from microslip.contact.normal import Hyperbolic, Rough
from microslip.contact.topography import SurfaceProfile, fit_roughness, heights, levelled, material_curve, roughness
from microslip.contact.wear import WearCourse, course

COLOURS = ("#0b4f9c", "#d98410", "#5a8f3c", "#c8382c", "#7a4fa3", "0.45")
SURFACES: dict[str, Heights] = {
    "polynomial (3.3-4)": Polynomial(),
    "linear": Linear(),
    "exponential, cut": Cut(Exponential()),
    "Gaussian, cut": Cut(Gaussian()),
}
FORCE = 0.09375
TIMES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)


def ground(points: int = 4001) -> SurfaceProfile:
    """An invented ground surface: grooves 20 µm apart and waviness, its peaks dulled; 8 mm long, tilted."""
    rng = np.random.default_rng(6)
    x = np.linspace(0, 8e-3, points)
    noise = np.convolve(rng.normal(size=points + 60), np.hanning(15), "same")[30:-30]
    z = 2.4e-6 * noise / noise.std() + 0.8e-6 * np.sin(2 * np.pi * x / 2.5e-3)
    return SurfaceProfile(x, np.where(z > 0, 3e-6 * np.tanh(z / 3e-6), z) + 5e-4 * x, "ground.txt")


def numbers() -> tuple[list[str], list[list[str]]]:
    """Roughness numbers of the invented surface, as measured and levelled."""
    head = ["`level`", "Ra, µm", "Rq, µm", "Rz, µm", "Rmax, µm", "Rt, µm", "R_Z of (3.3-4), µm", "residual of the area"]
    rows = []
    for level in (None, 1, 2):
        profile = levelled(ground(), level)
        r, fit = roughness(profile), fit_roughness(profile)
        lengths = (r.Ra, r.Rq, r.Rz, r.Rmax, r.Rt, fit.roughness)
        rows.append([str(level), *(f"{1e6 * v:.2f}" for v in lengths), f"{100 * fit.residual:.1f} %"])
    return head, rows


def worn() -> tuple[list[str], list[list[str]]]:
    """The book's example by its exact course."""
    head = ["t*", "approach u*", "area in contact", "largest p*", "roughness", "stiffness over the new one's"]
    found = _course()
    rows = []
    for i, t in enumerate(TIMES):
        row = (
            found.approach[i],
            found.area[i],
            found.pressure[i, 0],
            found.roughness[i],
            found.area[i] / found.area[0],
        )
        rows.append([f"{t:g}", *(f"{v:.4f}" for v in row)])
    return head, rows


def _course() -> WearCourse:
    return course(Polynomial(), FORCE, np.array(TIMES), 1025)


def laws(fig: Any, plain: Any) -> Any:
    """Left: area over approach. Middle: force. Right: tangential stiffness over the force, short layers."""
    left, middle, right = fig.subplots(1, 3, gridspec_kw={"wspace": 0.08})
    u = np.linspace(-0.2, 1.5, 400)
    for (name, surface), colour in zip(SURFACES.items(), COLOURS, strict=False):
        plain(left)
        left.plot(u, surface.area(u), color=colour, label=name)
        plain(middle)
        middle.plot(u, surface.volume(u), color=colour)
    middle.plot(u, np.maximum(u, 0), color="0.45", ls="--", label="no roughness")
    plain(right)
    for ratio, colour in zip((0.01, 0.1, 0.3, 0.5), COLOURS, strict=False):
        law, s = Hyperbolic(1.0, 1.0, Polynomial(), 1 / ratio), np.linspace(0, 1.6, 300)
        right.plot(law.force(s), law.share(s), color=colour, label=f"R_Z / l₀ = {ratio:g}")
    left.set(xlabel="approach u / R_Z", ylabel="share of the area in contact", ylim=(-0.05, 1.6))
    middle.set(xlabel="approach u / R_Z", ylabel="force / (c_N0 R_Z)", ylim=(-0.03, 1.0))
    right.set(xlabel="force / (c_N0 R_Z)", ylabel="tangential stiffness / c_R0", xlim=(0, 1.0), ylim=(0, 2.6))
    left.legend(frameon=False, fontsize=8, loc="upper left")
    middle.legend(frameon=False, fontsize=8, loc="upper left")
    right.legend(frameon=False, fontsize=8, loc="upper left")
    return fig


def profile(fig: Any, plain: Any) -> Any:
    """Left: the profile. Middle: its distribution and the fits. Right: the laws."""
    left, middle, right = fig.subplots(1, 3, gridspec_kw={"wspace": 0.08})
    surface = levelled(ground())
    r, fit = roughness(surface), fit_roughness(surface)
    depth, share = material_curve(surface)
    for axes in (left, middle, right):
        plain(axes)
    part = surface.x <= 2e-3
    left.plot(1e3 * surface.x[part], 1e6 * surface.z[part], color=COLOURS[0], lw=0.8)
    left.set(xlabel="x, mm (a quarter of it)", ylabel="z, µm")
    middle.plot(1e6 * depth, share, color=COLOURS[0], label="measured")
    fits = (("R_Z fitted", fit.roughness, "-"), ("R_Z = Rz", r.Rz, "--"), ("R_Z = Rt", r.Rt, ":"))
    u = np.linspace(0, 1.05 * depth[-1], 300)
    own = Rough(1e9, r.Rz, heights(surface, r.Rz))
    right.plot(1e6 * u, 1e-3 * np.asarray(own.force(u)), color=COLOURS[0])
    for (name, length, line), colour in zip(fits, COLOURS[1:], strict=False):
        middle.plot(1e6 * u, Polynomial().area(u / length), color=colour, ls=line, label=name)
        right.plot(1e6 * u, 1e-3 * np.asarray(Rough(1e9, length, Polynomial()).force(u)), color=colour, ls=line)
    middle.set(xlabel="depth below the highest peak, µm", ylabel="share of the length that is higher")
    middle.legend(frameon=False, fontsize=8, loc="upper left")
    right.set(xlabel="approach u, µm", ylabel="force, kN, of c_N0 = 1e9 N/m")
    return fig


def wear(fig: Any, plain: Any) -> Any:
    """Left and middle: Figs 3.9-2 and 3.9-3. Right: area, largest pressure and roughness over time."""
    left, middle, right = fig.subplots(1, 3, gridspec_kw={"wspace": 0.08})
    found = _course()
    for axes in (left, middle, right):
        plain(axes)
    for i, (t, colour) in enumerate(zip(TIMES, COLOURS, strict=True)):
        left.plot(found.depth[i], found.share, color=colour, label=f"t* = {t:g}")
        middle.plot(found.share, found.pressure[i], color=colour)
    left.set(xlabel="depth x / R_Z", ylabel="share of the area that is higher")
    middle.set(xlabel="share z of the area", ylabel="pressure p*", xlim=(0, 1))
    left.legend(frameon=False, fontsize=8, loc="upper left")
    times = np.linspace(0, 8, 200)
    fine = course(Polynomial(), FORCE, times)
    right.plot(times, fine.area, color=COLOURS[0], label="area in contact")
    right.plot(times, fine.roughness, color=COLOURS[1], label="roughness / R_Z")
    right.plot(times, fine.pressure[:, 0], color=COLOURS[3], label="largest p*")
    right.axhline(FORCE, color="0.45", lw=0.8, ls="--")
    right.annotate("F*", (7.6, FORCE + 0.015), color="0.45", fontsize=9)
    right.set(xlabel="time t*", ylim=(0, 1.05))
    right.legend(frameon=False, fontsize=8, loc="center right")
    return fig
