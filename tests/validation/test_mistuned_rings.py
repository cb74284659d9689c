"""Mistuned rings with friction: harmonic balance of the whole ring against motion in time of all its blades."""

from __future__ import annotations

import numpy as np
import pytest

import microslip as ms
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.solver import solve
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import amplitudes
from microslip.mistuning.scatter import Scatter

FREQUENCY = 384.0


@pytest.mark.slow
def test_three_patterns_against_motions_in_time() -> None:
    """First harmonics of every blade, harmonics raised until they change by less than 3e-5: 1e-4 of the largest.

    Motions begin on the balance: contacts that stick remember how they came to, which from rest is another way and
    gives amplitudes that differ by up to 3e-3.
    """
    rub = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
           "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}  # fmt: skip
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 2,
            "damping_ratio": 0.01, "ring": {"blades": 4, "engine_order": 1}, "contacts": [rub]}  # fmt: skip
    tuned = Tuned(ms.assemble(case, vane=ms.sample()).assembly, {})
    s = Scatter("frequency", 0.01)
    for seed in (1, 2, 3):
        ring = tuned.mistuned([(s, s.drawn(4, 2, 0, seed, 0))])
        fewer, found = (_balanced(ring, H) for H in (15, 21))
        size = np.abs(found).max()
        assert np.abs(fewer - found).max() < 3e-5 * size
        orbit = ms.integrate(ring, FREQUENCY, settle=100, keep=4, samples=256, steps=4096, start="balance")
        turn = np.exp(-1j * 2 * np.pi * FREQUENCY * orbit.time)
        whole = 4 * 256
        in_time = 2 * (orbit.y[:, -whole:] * turn[-whole:]).mean(axis=1)
        assert np.abs(in_time - found).max() < 1e-4 * size
        assert np.ptp(np.abs(found)) > 0.04 * size


def _balanced(ring: object, harmonics: int) -> np.ndarray:
    p = balance.of(ring, harmonics, 1024, form="sides")  # type: ignore[arg-type]
    point = solve(p, 2 * np.pi * FREQUENCY, [])
    assert point.converged, point.status
    return amplitudes(p.at(point.Omega), point.x)
