"""Blade deviations from measured modes: rings whose modes are known in closed form, and how often intervals hold."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from refusals import refused

from microslip.errors import UserError
from microslip.mistuning import identification
from microslip.mistuning.identification import blades_from_modes

NOISE = {"frequency_noise": 1e-5, "shape_noise": 0.01}


def masses_in_a_ring(deviation, coupling=0.05):
    """Masses on springs of their own, (2 pi 100 (1 + d) s^-1)^2, joined to their neighbours: frequencies and shapes,
    and the tuned frequencies 100 sqrt(1 + 4 c sin^2(pi n / N))."""
    N = len(deviation)
    to_next = np.eye(N) - np.roll(np.eye(N), 1, axis=1)
    values, modes = np.linalg.eigh(np.diag((1 + deviation) ** 2) + coupling * to_next.T @ to_next)
    tuned = 100 * np.sqrt(1 + 4 * coupling * np.sin(np.pi * np.arange(N // 2 + 1) / N) ** 2)
    return 100 * np.sqrt(values), modes.T, tuned


def noisy(frequency, shapes, rng, frequency_noise, shape_noise):
    shapes = shapes / np.abs(shapes).max(axis=1, keepdims=True)
    return (
        frequency * (1 + frequency_noise * rng.standard_normal(frequency.shape)),
        shapes + shape_noise * rng.standard_normal(shapes.shape),
    )


@pytest.mark.parametrize("N", [9, 12])
@pytest.mark.parametrize("find_tuned", [False, True])
def test_masses_in_a_ring(N, find_tuned):
    """Exactly, from modes without noise: the blades' share of the energy is (f_blade / f_n)^2 there."""
    e = np.random.default_rng(1).normal(0, 0.02, N)
    d = np.sqrt(1 + 2 * (e - e.mean())) - 1
    f, shapes, tuned = masses_in_a_ring(d)
    guess = tuned * (1 + 0.003 * np.cos(np.arange(len(tuned)))) if find_tuned else tuned
    found = blades_from_modes(guess, f, 3 * shapes, **NOISE, share=(100 / tuned) ** 2, find_tuned=find_tuned)
    # with tuned frequencies that are not known p follows their guesses, by 0.3 % of the coupling's part
    assert np.allclose(found.deviation, d, atol=1e-9 if not find_tuned else 3e-4)
    assert found.misfit < 1e-4 or find_tuned


def test_as_many_modes_as_blades_in_columns():
    """An array of eigenvectors as eigh gives them is not taken for its rows."""
    f, shapes, tuned = masses_in_a_ring(np.random.default_rng(1).normal(0, 0.02, 9))
    refused("columns", blades_from_modes, tuned, f, shapes.T, **NOISE, share=(100 / tuned) ** 2)


def test_the_tuned_frequencies_are_found():
    """Those of the fundamental mistuning model K = Omega (1 + 2 D) Omega, exactly, from guesses 0.5 % beside them."""
    N, rng = 10, np.random.default_rng(2)
    tuned = 100 + 5 * np.sqrt(np.arange(6))
    e = rng.normal(0, 0.02, N)
    d = np.sqrt(1 + 2 * (e - e.mean())) - 1
    k, j = np.arange(N), np.arange(N)[:, None]
    F = np.exp(2j * np.pi * k * j / N) / np.sqrt(N)
    root = ((F * tuned[np.minimum(k, N - k)]) @ F.conj().T).real
    values, modes = np.linalg.eigh((root * (1 + d) ** 2) @ root)
    found = blades_from_modes(tuned + rng.normal(0, 0.5, 6), np.sqrt(values), modes.T, **NOISE, find_tuned=True)
    assert np.allclose(found.deviation, d, atol=1e-9) and np.allclose(found.tuned, tuned, rtol=1e-9)


def test_uniform_shifts():
    """All blades higher by d: every frequency by d, whatever the coupling; and the shapes stay those of the waves."""
    tuned = 100 + 3 * np.arange(5.0)
    N, waves = 8, scipy.linalg.dft(8) / np.sqrt(8)
    shapes = np.array([np.real(w) + np.imag(w) for w in waves[[0, 1, 7, 2, 6, 3, 5, 4]]])
    found = blades_from_modes(tuned, 1.013 * tuned[[0, 1, 1, 2, 2, 3, 3, 4]], shapes, **NOISE)
    assert np.allclose(found.deviation, 0.013, atol=1e-10) and len(found.deviation) == N


@pytest.mark.parametrize("find_tuned", [False, True])
def test_derivatives_of_the_modes(find_tuned):
    """Against central differences, to 1e-6."""
    rng = np.random.default_rng(3)
    f, shapes, tuned = masses_in_a_ring(rng.normal(0, 0.02, 7))
    ring = identification._Family(tuned, np.asarray(0.9), find_tuned, 7)
    measured = identification._Measured.of(ring, *noisy(f, shapes, rng, **NOISE), 1e-5, 0.01)
    y, h = ring.start(measured), 1e-7
    exact = measured.compare(ring, y)[1]
    ways = h * np.eye(len(y))
    near = np.array([measured.compare(ring, y + w)[0] - measured.compare(ring, y - w)[0] for w in ways]).T / (2 * h)
    assert np.allclose(exact, near, rtol=1e-6, atol=1e-6 * np.abs(exact).max())


def covered(repeats, N, find_tuned, **noise):
    rng, inside, misfit = np.random.default_rng(4), [], []
    for _ in range(repeats):
        e = rng.normal(0, 0.015, N)
        d = np.sqrt(1 + 2 * (e - e.mean())) - 1
        f, shapes, tuned = masses_in_a_ring(d)
        share = (100 / tuned) ** 2
        found = blades_from_modes(tuned, *noisy(f, shapes, rng, **noise), **noise, share=share, find_tuned=find_tuned)
        low, high = found.interval()
        inside.append((low < d) & (d < high))
        misfit.append(found.misfit)
    return np.mean(inside), np.mean(misfit)


def test_intervals_hold_as_often_as_they_say():
    """8 blades of 60 rings: 95 % within what so many can tell, and a misfit of 1."""
    inside, misfit = covered(60, 8, False, frequency_noise=5e-5, shape_noise=0.02)
    assert inside == pytest.approx(0.95, abs=0.035) and misfit == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("find_tuned", [False, True])
def test_intervals_hold_over_many_rings(find_tuned):
    """95 +- 2 % of 4800 intervals."""
    inside, misfit = covered(400, 12, find_tuned, frequency_noise=5e-5, shape_noise=0.02)
    assert inside == pytest.approx(0.95, abs=0.02) and misfit == pytest.approx(1.0, abs=0.02)


def test_a_wrong_model_shows_in_the_misfit():
    """Tuned frequencies that are wrong by 0.1 % are told from noise of 1e-5."""
    rng = np.random.default_rng(5)
    f, shapes, tuned = masses_in_a_ring(rng.normal(0, 0.02, 12))
    wrong = tuned * (1 + 1e-3 * (-1.0) ** np.arange(7))
    measured = noisy(f, shapes, rng, **NOISE)
    assert blades_from_modes(wrong, *measured, **NOISE, share=(100 / tuned) ** 2).misfit > 3
    assert not blades_from_modes(wrong, *measured, **NOISE, share=(100 / tuned) ** 2).fits
    assert blades_from_modes(tuned, *measured, **NOISE, share=(100 / tuned) ** 2).fits


@pytest.mark.parametrize(
    "change",
    [
        {"tuned": [100.0, 101.0]},
        {"frequency": [100.0, 101.0]},
        {"shapes": np.ones((8, 8)) * 1j},
        {"shapes": np.zeros((8, 8))},
        {"share": 1.2},
        {"shape_noise": 0.0},
        {"frequency": [100.0], "shapes": [[0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]]},
    ],
)
def test_what_says_nothing_of_the_blades(change):
    f, shapes, tuned = masses_in_a_ring(np.random.default_rng(6).normal(0, 0.02, 8))
    with pytest.raises(UserError):
        blades_from_modes(**({"tuned": tuned, "frequency": f, "shapes": shapes, **NOISE} | change))
