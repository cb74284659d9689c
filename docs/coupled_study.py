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
from microslip.harmonic_balance.sweeps import brackets

BAND = np.linspace(70.0, 125.0, 56)
WIDE = np.linspace(90.0, 300.0, 43)
SHOWN = np.unique(np.concatenate([
    np.linspace(90, 110, 11), np.linspace(110, 122, 49), np.linspace(124, 244, 31), np.linspace(245, 275, 61),
    np.linspace(278, 300, 12),
]))  # fmt: skip
DAMPER = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Normal forces of the damper, N."""


@dataclass(frozen=True)
class StressedResonance:
    """The highest of a band: normal force (N), Hz, m (nan if there is none); its sweep, Hz and m (f,)."""

    normal: float
    frequency: float
    amplitude: float
    swept: tuple[Array, Array]


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


def dampers(basis: ModalBasis) -> tuple[list[tuple[float, Highest]], list[tuple[float, Array]]]:
    """The ring with shrouds and dampers: highest resonances over the damper's force, and three of the responses (m)."""
    built = opened("multicoupling", lambda _: basis)
    problems = {normal: problem_of(built, normal) for normal in DAMPER}
    found = [(normal, highest(p, basis, WIDE)) for normal, p in problems.items()]
    return found, [(normal, amplitudes(problems[normal], SHOWN)) for normal in (10.0, 30.0, 300.0)]


def dampers_picture(
    found: Sequence[tuple[float, Highest]], curves: Sequence[tuple[float, Array]], without: Array, left: Any, right: Any
) -> None:  # fmt: skip
    """Figure 5.5-9: responses with (three forces) and without a damper; amplitude and stress over its normal force."""
    left.semilogy(SHOWN, 1e6 * without, color="0.6", lw=1.2, label="no damper")
    for normal, size in curves:
        left.semilogy(SHOWN, 1e6 * size, lw=1.4, label=f"{normal:g} N")
    left.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the accelerometer in µm")
    left.legend(title="force in the damper", fontsize=8)
    some = [(n, h) for n, h in found if n]
    forces = [n for n, _ in some]
    right.loglog(forces, [1e6 * h.amplitude for _, h in some], "o-", ms=4, label="amplitude in µm")
    right.loglog(forces, [1e-6 * h.stress for _, h in some], "s-", ms=4, label="stress at the foot in MPa")
    right.set(xlabel="normal force in the damper in N", ylabel="highest resonance", ylim=(1.0, 20.0))
    right.legend(fontsize=8)


def row(words: str, h: Highest) -> list[str]:
    """A line of the page's table."""
    share = f"{h.open:.2f}" if h.open > 5e-3 else "0"
    words += f" ({h.failed} points without a solution)" if h.failed else ""
    return [words, f"{h.frequency:.1f}", f"{1e6 * h.amplitude:.3g}", f"{1e-6 * h.stress:.3g}", share]
