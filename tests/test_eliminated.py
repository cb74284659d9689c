"""The coordinates of a body eliminated by its eigenvalues: what the equations themselves give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_harmonic_balance_time import group, held

from microslip.contact.sliders import jenkins
from microslip.harmonic_balance import blocks, reduced, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.readout import amplitude
from microslip.harmonic_balance.reduced import Eliminated, seen
from microslip.harmonic_balance.solver import solve
from microslip.system.assembly import Linear


def part(seed: int = 0, rigid: int = 0) -> Linear:
    """Eight coordinates, damped and gyroscopic beyond any proportion, complex rows, four contact coordinates."""
    rng = np.random.default_rng(seed)
    m, c = 8, 4
    A, D, G = (rng.normal(size=(m, m)) for _ in range(3))
    K = np.diag(np.r_[np.zeros(rigid), 10.0 ** np.linspace(2, 6, m - rigid)])
    M = np.eye(m) + 0.05 * A @ A.T
    C = 0.2 * (D @ D.T) + 3.0 * (G - G.T)
    rows = rng.normal(size=(c, m)) + 1j * rng.normal(size=(c, m))
    residual = 1e-5 * np.diag(rng.uniform(0.5, 1, c))
    load, given = (rng.normal(size=n) + 1j * rng.normal(size=n) for n in (m, c))
    none = np.zeros((0, m)), np.zeros((0, c)), np.zeros(0, complex)
    return Linear(M, K, C, rows, residual, load, 1e-5 * given, *none)


@pytest.mark.parametrize("rigid", [0, 2])
def test_sums_over_the_eigenvalues_are_the_solutions_of_the_equations(rigid: int) -> None:
    """Compliance, reference and their rates in every harmonic, also of a body that its contacts alone hold; the
    derivative with respect to Omega against differences."""
    first, k = part(rigid=rigid), 1e5 * np.diag([1.0, 2, 3, 4])
    calm = replace(first, load=np.zeros(8, complex), given=np.zeros(4, complex))
    other = replace(first, M=2 * first.M)  # another harmonic may be that of another nodal diameter
    whole = Eliminated((calm, first, other, first), k)
    assert whole.poles is not None and [list(p.harmonics) for p in whole.poles] == [[0, 1, 3], [2]]
    for Omega in (3.0, 40.0, 700.0):
        view = whole.at(Omega)
        for h, one in enumerate(whole.parts):
            exact = seen(one, k, Omega, h)
            for key, place in (("compliance", np.s_[..., 1:]), ("reference", np.s_[..., 0])):
                both = getattr(exact, key), getattr(exact, f"{key}_rate")
                for found, expected in zip(view[place][:, h], both, strict=True):
                    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
        step = 1e-5 * Omega
        along = (whole.at(Omega + step)[0, ..., 1:] - whole.at(Omega - step)[0, ..., 1:]) / (2 * step)
        np.testing.assert_allclose(view[1, ..., 1:], along, rtol=0, atol=1e-6 * np.abs(along).max())


def test_eigenvalues_that_tell_too_little_are_not_used() -> None:
    """A coordinate that no contact feels and nothing holds has a double eigenvalue of zero with one eigenvector; the
    equations can still be solved where it vibrates."""
    one = part(rigid=1)
    rows, C = one.rows.copy(), np.zeros((8, 8))
    rows[:, 0] = 0.0
    free = replace(one, M=np.eye(8), C=C, rows=rows)
    whole = Eliminated((free, free), np.eye(4))
    assert whole.poles is None
    mean, first = whole.directly(10.0)[0]
    assert np.isnan(mean[:, 0]).all() and np.isfinite(first).all()  # its mean is nowhere


@pytest.mark.parametrize("by_eigenvalues", [True, False])
def test_without_damping_the_resonance_of_the_stuck_contact_is_a_point_as_any(by_eigenvalues, monkeypatch) -> None:
    """Two masses on springs of 1 and 2.5, a slider of spring 3 on one of them, no damping, driven at the resonances of
    the sticking contact: the excitation's work is the friction's loss, and what is read is between what is
    read a thousandth beside it."""
    if not by_eigenvalues:
        monkeypatch.setattr(reduced, "POLES_AT_MOST", 0)
    squares, tip = np.array([1.0, 2.5]), np.array([1.0, 0.6])
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], tip), "push": np.array([1.0, -0.4]), "tip": np.array([0.3, 1.0])}
    one = held(group(np.sqrt(squares), rows, 0.0), jenkins(3.0, 0.25, 1.0), [1], np.zeros(1), np.zeros(1), 0.3)
    p = balance.of(one, 3, 128, length=0.1)
    for stuck in np.sqrt(np.linalg.eigvalsh(np.diag(squares) + 3.0 * np.outer(tip, tip))):
        found = []
        for Omega in stuck * np.array([0.999, 1.0, 1.001]):
            point, at = solve(p, Omega, []), p.at(Omega)
            assert point.converged
            o = response.operating(p, point)
            lost = sum(float(c.dissipated.sum()) for c in o.cycles.values())
            assert o.supplied == pytest.approx(lost, rel=2e-3) and lost > 0  # the loss by the trapezoidal rule
            assert amplitude(at, point.x, *at.forces(point.x)).value == pytest.approx(o.outputs[0, 1], rel=1e-9)
            found.append(abs(o.outputs[0, 1]))
        assert found[1] == pytest.approx(0.5 * (found[0] + found[2]), rel=1e-4)


@pytest.mark.parametrize(
    "pairs, row",
    [
        ([(0, 3), (3, 5), (5, 1), (1, 4), (4, 2), (2, 0)], True),  # a ring
        ([(0, 3), (3, 5), (1, 4), (4, 2)], True),  # two chains
        ([(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3)], False),  # two rings
        ([(0, 1), (0, 2), (0, 3), (4, 5)], False),  # a star
    ],
)
def test_parts_in_a_row_are_solved_one_by_one_however_they_are_numbered(pairs, row) -> None:
    """The solution is that of the dense matrix, of the transposed one too."""
    rng, sizes, W = np.random.default_rng(3), [2, 1, 3, 2, 1, 2], 3
    every = [(i, i) for i in range(6)] + pairs + [(j, i) for i, j in pairs]
    pieces = {(i, j): 0.1 * rng.normal(size=(W * sizes[i], W * sizes[j])) for i, j in every}
    ends = np.cumsum([0, *sizes])
    A = np.zeros((W, ends[-1], W, ends[-1]))
    for (i, j), block in pieces.items():
        own = block.reshape(W, sizes[i], W, sizes[j])
        A[:, ends[i] : ends[i + 1], :, ends[j] : ends[j + 1]] = own
    dense = np.eye(W * ends[-1]) + A.reshape(W * ends[-1], -1)
    made = blocks.one_plus(pieces, sizes, W)
    assert isinstance(made, blocks.CyclicMatrix if row else blocks.DenseMatrix)
    right = rng.normal(size=len(dense))
    np.testing.assert_allclose(made.solve(right), np.linalg.solve(dense, right), rtol=0, atol=1e-13)
    np.testing.assert_allclose(made.transposed.solve(right), np.linalg.solve(dense.T, right), rtol=0, atol=1e-13)
    np.testing.assert_allclose(made.dense(), dense, rtol=0, atol=1e-15)
