"""Picture of docs/harmonic_balance.md: stability, a nonlinear mode, and an optimum that is followed."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from microslip import continuation
from microslip.contact.friction import Coulomb
from microslip.contact.law import Law, settings
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.data import ModalGroup
from microslip.harmonic_balance.nonlinear_modes import backbone
from microslip.harmonic_balance.peak import highest, optimum, resonance
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.readout import WithOutput
from microslip.harmonic_balance.response import of_body
from microslip.harmonic_balance.solver import sweep
from microslip.harmonic_balance.stability import orbit, stability
from microslip.system import Body, Contact, Force, Monitor, Spring, System

BLUE, RED, GREY = "#0b4f9c", "#c8382c", "#8b93a1"


@settings
class Cubic(Law):
    """k u^3 along t1."""

    k: jax.Array

    def init(self, n: int) -> tuple[()]:
        return ()

    def step(self, u: Any, v: Any, dt: Any, state: Any) -> tuple[Any, Any]:
        return jnp.zeros_like(u).at[:, 1].set(self.k * u[:, 1] ** 3), state


def block(ratio: float) -> ModalGroup:
    """1 kg on 4e4 N/m (31.8 Hz) that moves along its sole."""
    legs = [Spring("ground", "block", (4e4, 4e6, 4e6, 4e3, 4e3, 4e3))]
    sole = Contact("sole", "block", (0, 0, -1), t2=(0, 1, 0), at=(0, 0, 0))
    body = Body("block", 1.0, (0.0, 0.0, 0.0), inertia=(0.01, 0.01, 0.01))
    push, middle = Force("push", "block", (1, 0, 0)), Monitor("middle", "block")
    return System("sled", [body], legs, [sole], [push], [middle], ratio=ratio).basis().groups[0, 0]


def driven(patch: Patch, normal: float, force: float, ratio: float = 0.01, **fine: Any) -> Problem:
    g = block(ratio)
    push, middle = g.excitations["push"].rows[0], g.monitors["middle"].rows[0]
    return of_body(g, (patch,), np.array([normal]), force * push, middle, **fine)


def rubbing(normal: float, force: float = 1.0) -> Problem:
    """Sixteen points that slide one after the other: they share the normal force unequally."""
    places, areas = grid(0.06, 0.01, (16, 1))
    n = len(areas)
    shares = jnp.linspace(0.3, 1.7, n)
    law = PointContact(Penalty(4e6 / n * shares), Coulomb(jnp.asarray(0.3)), jnp.asarray(4e4 / n))
    return driven(Patch("sole", places, areas, law), normal, force, harmonics=3, samples=256, length=1e-5)


def duffing(axes: Any) -> None:
    """Solutions over the frequency, stable and unstable; the folds and the largest multiplier there."""
    patch = Patch("sole", np.zeros((1, 2)), np.ones(1), Cubic(jnp.asarray(4e10)))
    problem = driven(patch, 0.0, 1.6, 0.02, harmonics=7, samples=128, length=1e-3)
    low = 2 * np.pi * 20.0
    bounds = continuation.Settings(low=low, high=2 * np.pi * 70.0, step_max=0.03)
    branch = continuation.trace(problem, problem.at(low).reference, low, bounds)
    watched = WithOutput(problem)
    f = branch.lam / (2 * np.pi)
    a = 1e3 * np.sqrt([watched.output(p.x, p.lam)[0] for p in branch.points])
    stable = np.array([stability(orbit(problem, p.x, p.lam)).stable for p in branch.points])
    axes.plot(f, np.where(stable, a, np.nan), color=BLUE, lw=1.8, label="stable")
    axes.plot(f, np.where(stable, np.nan, a), color=RED, lw=1.6, ls="--", label="not stable")
    for p in branch.of_kind("fold"):
        mu = stability(orbit(problem, p.x, p.lam)).multipliers
        nearest = mu[np.argmin(np.abs(mu - 1))].real
        at = p.lam / (2 * np.pi), 1e3 * np.sqrt(watched.output(p.x, p.lam)[0])
        axes.plot(*at, "o", color=RED, ms=5)
        axes.annotate(f"$\\mu$ = {nearest:.4f}", at, xytext=(6, 2), textcoords="offset points", fontsize=8)
    axes.set(xlabel="frequency in Hz", ylabel="amplitude in mm", title="a hardening spring: multipliers at its folds")
    axes.legend(fontsize=8, loc="upper left")


def mode(axes: Any) -> None:
    """Backbone, and the peaks of the forced response at several loads."""
    found = backbone(rubbing(10.0), 1e-6, 1e-3)
    axes.semilogx(1e6 * found.amplitude, found.Omega / (2 * np.pi), color=BLUE, lw=1.8, label="nonlinear mode")
    other = axes.twinx()
    other.semilogx(1e6 * found.amplitude, 100 * found.damping, color=GREY, lw=1.4)
    other.set_ylabel("damping ratio in %", color=GREY)
    other.spines[["top"]].set_visible(False)
    band = 2 * np.pi * np.linspace(28, 50, 45)
    peaks = [resonance(highest(rubbing(10.0, F), band)[0]) for F in (0.3, 1, 2, 3, 4)]
    good = [p for p in peaks if p.status == "converged"]
    axes.plot([1e6 * p.amplitude for p in good], [p.Omega / (2 * np.pi) for p in good], "o", color=RED, ms=5,
              label="peaks of forced responses")  # fmt: skip
    axes.set(xlabel="amplitude in µm", ylabel="frequency in Hz", title="sixteen sliding points: mode and resonances")
    axes.legend(fontsize=8, loc="center left")


def valley(axes: Any) -> None:
    """The highest resonance over the normal force: peaks on the curve, and sweeps to compare with."""
    band = 2 * np.pi * np.linspace(28, 48, 41)
    best = optimum(rubbing, [3.8, 5.0, 8.0, 14.0], band)
    tops = [1e6 * one.amplitude for one in best.found.values()]
    axes.plot(list(best.found), tops, "o", color=BLUE, ms=5, label="peaks")
    axes.plot(best.parameter, 1e6 * best.resonance.amplitude, "o", ms=11, mfc="none", mec=RED, mew=1.8, label="optimum")
    forces = np.geomspace(3.8, 14, 21)
    swept = []
    for normal in forces:
        problem = rubbing(float(normal))
        watched = WithOutput(problem)
        heights = [watched.output(p.x, p.Omega)[0] for p in sweep(problem, band / (2 * np.pi)) if p.converged]
        swept.append(1e6 * np.sqrt(max(heights)))
    axes.plot(forces, swept, color=GREY, lw=1.2, zorder=0, label="highest of 41 frequencies")
    axes.annotate(f"{best.parameter:.3g} N", (best.parameter, 1e6 * best.resonance.amplitude), xytext=(4, 12),
                  textcoords="offset points", ha="left", fontsize=9, color=RED)  # fmt: skip
    axes.set(xlabel="normal force in N", ylabel="highest resonance in µm", title="optimal normal force")
    axes.legend(fontsize=8)


def three(fig: Any, plain: Any) -> Any:
    for axes, panel in zip(fig.subplots(1, 3), (duffing, mode, valley), strict=True):
        plain(axes)
        panel(axes)
        axes.title.set_fontsize(10)
    return fig
