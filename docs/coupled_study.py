"""The three-body rig of Sextro section 5.3 and the multiple coupling of section 5.5 over their normal forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from damper_study import Bases, opened
from ring_study import Highest, amplitudes, frf, highest

from microslip.case.problem import problem_of
from microslip.data import Array, ModalBasis
from microslip.harmonic_balance import response
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.sweeps import brackets

BAND = np.linspace(70.0, 125.0, 56)
WIDE = np.concatenate([np.linspace(90, 230, 15), np.linspace(235, 275, 41), np.linspace(280, 300, 5)])
SHOWN = np.unique(np.concatenate([
    np.linspace(90, 110, 11), np.linspace(110, 122, 49), np.linspace(124, 244, 31), np.linspace(245, 275, 61),
    np.linspace(278, 300, 12),
]))  # fmt: skip
NEAR = np.linspace(248.0, 268.0, 41)
"""Hz about the resonance with dampers that open, where more harmonics are swept."""
DAMPER = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Normal forces of the damper, N."""


@dataclass(frozen=True)
class StressedResonance:
    """The highest of a band: normal force (N), Hz, m (nan if there is none); its sweep, Hz and m (f,)."""

    normal: float
    frequency: float
    amplitude: float
    swept: tuple[Array, Array]


@dataclass(frozen=True)
class Dampers:
    """Over the damper's normal force (N): its highest resonance, and responses (m) upwards and downwards over `SHOWN`,
    one harmonic; those over `NEAR` with nine."""

    highest: dict[float, Highest]
    swept: dict[float, tuple[Array, Array]]
    more: dict[float, tuple[Array, Array]]

    def largest(self, normal: float) -> tuple[float, float]:
        """Hz and m, the largest of both sweeps with nine harmonics."""
        size = np.fmax(*self.more[normal])
        top = int(np.nanargmax(size))
        return float(NEAR[top]), float(size[top])


def over_forces(case: str, forces: Sequence[float], bases: Bases, *changes: str) -> list[StressedResonance]:
    """The highest resonance of an arrangement of the rig under each normal force (N). changes: of the case file."""
    built, found = opened(case, bases, *changes), []
    for normal in forces:
        problem = problem_of(built, normal)
        swept = frf(problem, BAND)
        peaks = filter(None, (response.highest(problem, swept, bracket) for bracket in brackets(swept)))
        sizes = [(size, point.Omega / (2 * np.pi)) for point, size in peaks]
        size, frequency = max(sizes, default=(np.nan, np.nan))
        found.append(StressedResonance(normal, frequency, size, (BAND, swept.columns()["amplitude_m"])))
    return found


def rig_picture(first: Sequence[StressedResonance], second: Sequence[StressedResonance], left: Any, right: Any) -> None:
    """Figures 5.3-7 and 5.3-11: responses of the first arrangement, resonances of both over the normal force."""
    for r in first:
        frequency, size = (np.append(x, y) for x, y in zip(r.swept, (r.frequency, r.amplitude), strict=True))
        order = np.argsort(frequency)
        left.semilogy(frequency[order], 1e6 * size[order], lw=1.4, label=f"{r.normal:g} N")
    left.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the accelerometer in µm")
    left.legend(title="normal force", fontsize=8)
    for found, words in ((first, "first arrangement"), (second, "second arrangement")):
        right.semilogx([r.normal for r in found], [r.frequency for r in found], "o-", ms=4, label=words)
    right.set(xlabel="normal force in N", ylabel="first resonance in Hz")
    right.legend(fontsize=8)


def dampers(basis: ModalBasis) -> Dampers:
    """The ring with shrouds and dampers."""

    def problems(*changes: str) -> dict[float, Problem]:
        built = opened("multicoupling", lambda _: basis, *changes)
        return {normal: problem_of(built, normal) for normal in DAMPER}

    one, nine = problems("samples=128"), problems("harmonics=9", "samples=128")
    return Dampers(
        {normal: highest(p, basis, WIDE) for normal, p in one.items()},
        {normal: both_ways(one[normal], SHOWN) for normal in (10.0, 30.0, 300.0)},
        {normal: both_ways(nine[normal], NEAR) for normal in (10.0, 30.0, 100.0)},
    )


def both_ways(problem: Problem, frequency: Array) -> tuple[Array, Array]:
    """(f,), (f,) amplitudes (m) swept upwards and downwards over frequency (Hz)."""
    return amplitudes(problem, frequency), amplitudes(problem, frequency[::-1])[::-1]


def dampers_picture(dampers: Dampers, without: Array, left: Any, right: Any) -> None:
    """Figure 5.5-9: responses with (three forces) and without a damper; amplitude and stress over its normal force."""
    left.semilogy(SHOWN, 1e6 * without, color="0.6", lw=1.2, label="no damper")
    for normal, (up, down) in dampers.swept.items():
        (line,) = left.semilogy(SHOWN, 1e6 * up, lw=1.4, label=f"{normal:g} N")
        left.semilogy(SHOWN, 1e6 * down, "--", lw=1.4, color=line.get_color())
    left.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the accelerometer in µm")
    left.legend(title="force in the damper\n(dashed: downwards)", fontsize=8)
    some = {n: h for n, h in dampers.highest.items() if n}
    amplitude, stress = (1e6 * h.amplitude for h in some.values()), (1e-6 * h.stress for h in some.values())
    right.loglog(list(some), list(amplitude), "o-", ms=4, label="amplitude in µm")
    right.loglog(list(some), list(stress), "s-", ms=4, label="stress at the foot in MPa")
    more = {n: 1e6 * dampers.largest(n)[1] for n in dampers.more}
    right.loglog(list(more), list(more.values()), "o", mfc="none", color="C0", label="amplitude, nine harmonics")
    right.set(xlabel="normal force in the damper in N", ylabel="highest resonance", ylim=(1.0, 20.0))
    right.legend(fontsize=8)


def rows(without: Highest, dampers: Dampers) -> list[list[str]]:
    """The page's table."""
    return [
        [*row("no damper", without), ""],
        *([*row(f"{n:g}", h), _finer(dampers, n)] for n, h in dampers.highest.items()),
    ]


def _finer(dampers: Dampers, normal: float) -> str:
    if normal not in dampers.more:
        return ""
    frequency, amplitude = dampers.largest(normal)
    return f"{1e6 * amplitude:.3g} µm at {frequency:.1f} Hz"


def row(words: str, h: Highest) -> list[str]:
    """A line of the page's table."""
    share = f"{h.open:.2f}" if h.open > 5e-3 else "0"
    words += f" ({h.failed} points without a solution)" if h.failed else ""
    return [words, f"{h.frequency:.1f}", f"{1e6 * h.amplitude:.3g}", f"{1e-6 * h.stress:.3g}", share]
