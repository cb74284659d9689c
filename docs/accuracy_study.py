"""Picture and table of docs/accuracy.md: what bounds and checks of a response say, against what is true."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from following_study import BLUE, GREY, RED, driven

from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.normal import Rough
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.harmonic_balance.accuracy import error
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import solve

SYSTEMS, HARMONICS = 40, (1, 3, 7)
SAMPLES = (16, 32, 64, 128, 256)
TRUE = {"harmonics": 24, "samples": 1024}


def system(seed: int, **fine: Any) -> tuple[Problem, float]:
    """1 kg on springs (31.8 Hz) on a rough sole of four points, and a frequency (Hz): drawn are the normal force, the
    load, the friction, the contact's stiffness against the springs', the roughness, the damping, the frequency."""
    rng = np.random.default_rng(seed)
    places, areas = grid(0.06, 0.02, (2, 2))
    k, mu, normal = 4e4 * 10 ** rng.uniform(-0.5, 1.0), rng.uniform(0.1, 0.6), rng.uniform(2.0, 40.0)
    rough = Rough(jnp.asarray(10 * k), jnp.asarray(10 ** rng.uniform(-6, -4.5)), Polynomial())
    law = PointContact(rough, Coulomb(jnp.asarray(mu)), jnp.asarray(k / 4))
    force, ratio = mu * normal * 10 ** rng.uniform(-0.7, 0.7), 10 ** rng.uniform(-2.5, -1.3)
    patch = Patch("sole", places, areas, law)
    frequency = 31.8 * np.sqrt(1 + rng.uniform(0, 1) * k / 4e4) * rng.uniform(0.9, 1.1)
    return driven(patch, normal, force, ratio, length=mu * normal / k, **fine), float(frequency)


def told(seed: int) -> dict[tuple[int, int], tuple[float, float, float]]:
    """(harmonics, samples) -> true error, its bound, energy that is not counted, all as shares."""
    fine, f = system(seed, **TRUE)
    exact = solve(fine, 2 * np.pi * f, [])
    right, out = abs(operating(fine, exact).outputs[0, 1]), {}
    for H, n in [(3, n) for n in SAMPLES] + [(H, 64) for H in HARMONICS]:
        problem, _ = system(seed, harmonics=H, samples=n)
        point = solve(problem, 2 * np.pi * f, [exact.x[: problem.size]])
        if exact.converged and point.converged:
            found = operating(problem, point)
            off = abs(abs(found.outputs[0, 1]) / right - 1)
            out[H, n] = float(off), error(problem, point.x, point.Omega).readout, abs(found.checks.counted)
    return out


def measured() -> list[dict[tuple[int, int], tuple[float, float, float]]]:
    """`told` of all systems."""
    return [told(seed) for seed in range(SYSTEMS)]


def rows(found: list[dict[tuple[int, int], tuple[float, float, float]]]) -> list[list[str]]:
    """Of every number of harmonics and samples: errors, how many are covered, energy not counted."""
    out = []
    for H, n in sorted({key for one in found for key in one}):
        true, bound, counted = np.array([one[H, n] for one in found if (H, n) in one]).T
        covered = int(((true <= bound) | (true < 1e-4)).sum())
        pairs = ((true, np.median), (true, np.max), (counted, np.median), (counted, np.max))
        out.append([str(H), str(n), *[f"{100 * of(x):.2g} %" for x, of in pairs], f"{covered} of {len(true)}"])
    return out


def figure(fig: Any, found: list[dict[tuple[int, int], tuple[float, float, float]]]) -> Any:
    """Left: bound over true error. Right: true error and energy that is not counted over the samples."""
    left, right = fig.subplots(1, 2)
    for H, colour in zip(HARMONICS, (RED, BLUE, GREY), strict=True):
        true, bound, _ = np.array([one[H, 64] for one in found if (H, 64) in one]).T
        left.loglog(100 * true, 100 * bound, ".", color=colour, ms=6, label=f"{H} harmonic" + "s" * (H > 1))
    ends = np.array([1e-4, 30.0])
    left.loglog(ends, ends, "k-", lw=0.8)
    left.annotate("as large as the error", (3e-3, 2e-3), fontsize=8, rotation=38)
    left.set(xlabel="true error of the amplitude in %", ylabel="its bound in %", xlim=ends, ylim=ends)
    left.set_title("the bound that is printed, 64 samples", fontsize=10)
    left.legend(fontsize=8, loc="upper left", frameon=False)
    counted = np.array([[one[3, n][2] for n in SAMPLES] for one in found if all((3, n) in one for n in SAMPLES)])
    right.loglog(SAMPLES, 100 * counted.T, color=GREY, lw=0.5)
    right.loglog(SAMPLES, 100 * np.median(counted, axis=0), "o-", color=BLUE, label="median of the systems")
    right.loglog(SAMPLES, 5.0 * np.ones(len(SAMPLES)), color=RED, lw=1.2, label="above it a point has not converged")
    right.set(xlabel="samples of a cycle", ylabel="work less counted loss, in %")
    right.set_ylim(1e-4, 20)  # sticking contacts leave 1e-12
    right.set_xticks(SAMPLES, [str(n) for n in SAMPLES])
    right.minorticks_off()
    right.set_title("energy of the contacts, 3 harmonics", fontsize=10)
    right.legend(fontsize=8, loc="lower left", frameon=False)
    return fig
