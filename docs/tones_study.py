"""Two tones: the motion that docs/two_tones.md draws, and its table of a slider."""

from __future__ import annotations

import numpy as np

import microslip as ms
from microslip.harmonic_balance.tones import Solved
from microslip.series import pairs_of, summed

RATIO = 0.5 * (np.sqrt(5.0) - 1.0)


def duffing() -> Solved:
    """As the page's first block asks."""
    forces = {"force": {0: 0.2}, "second_force": {0: 0.1}}
    system = ms.structure(1.0, 1.0, 0.05, **forces, elements=[ms.polynomial({3: 0.4})])
    return ms.two_tones(system, 1.3, 0.8123, harmonics=7, unit="rad/s")


def slider() -> tuple[list[str], list[list[str]]]:
    """Amplitudes of both tones over harmonics and samples, and those of motions in time."""
    element = ms.jenkins(1.0, 0.15)
    system = ms.structure(1.0, 1.0, 0.1, force={0: 0.2}, second_force={0: 0.1}, elements=[element])
    w = 0.9, 0.9 * RATIO
    rows = []
    for order, samples, turns in ((5, 40, 40), (7, 64, 56), (7, 256, 56), (7, 256, 144), (11, 256, 56)):
        found = ms.two_tones(system, *w, harmonics=order, samples=samples, turns=turns, unit="rad/s")
        sizes = [f"{abs(found.of(*k)[0]):.6f}" for k in ((1, 0), (0, 1))]
        rows.append([f"{order} harmonics", str(samples), str(turns), *sizes, f"{found.balance[0]:.0e}"])
    orbit = ms.integrate(system, w[0], second=w[1], unit="rad/s", settle=40, keep=300, samples=64, steps=2048)
    E = summed(orbit.time[:, None] * (pairs_of(21) @ np.array(w)))
    c = np.linalg.lstsq(E, orbit.y[0], rcond=None)[0]
    rows.append(["motion in time", "", "", *(f"{np.hypot(*c[i : i + 2]):.6f}" for i in (1, 3)), ""])
    return ["", "samples of a turn", "turns", "first tone, m", "second tone, m", "power missing"], rows
