"""Blade deviations found from measurements: the tables and the picture of docs/mistuning_identification.md."""

from __future__ import annotations

from typing import Any

import numpy as np

from microslip.data import Array
from microslip.mistuning import identification, weibull
from microslip.mistuning.identification import blades_from_modes

N = 24
SPREAD = 0.01
Table = tuple[list[str], list[list[str]]]


def ring(deviation: Array, coupling: float = 0.05) -> tuple[Array, Array, Array]:
    """Masses on springs of their own, 100 Hz, joined to their neighbours: Hz, shapes, Hz of the tuned ring."""
    n = len(deviation)
    to_next = np.eye(n) - np.roll(np.eye(n), 1, axis=1)
    values, modes = np.linalg.eigh(np.diag((1 + deviation) ** 2) + coupling * to_next.T @ to_next)
    tuned = 100 * np.sqrt(1 + 4 * coupling * np.sin(np.pi * np.arange(n // 2 + 1) / n) ** 2)
    return 100 * np.sqrt(values), modes.T, tuned


def drawn(rng: np.random.Generator) -> Array:
    e = rng.normal(0, SPREAD, N)
    return np.sqrt(1 + 2 * (e - e.mean())) - 1


def noisy(rng: np.random.Generator, f: Array, shapes: Array, df: float, dshape: float) -> tuple[Array, Array]:
    shapes = shapes / np.abs(shapes).max(axis=1, keepdims=True)
    return f * (1 + df * rng.standard_normal(f.shape)), shapes + dshape * rng.standard_normal(shapes.shape)


def modes(repeats: int = 200) -> Table:
    """Accuracy and coverage over many rings of 24 blades."""
    rows = []
    for df, dshape, count, find in (
        (1e-5, 0.01, N, False), (1e-4, 0.01, N, False), (1e-4, 0.05, N, False), (1e-4, 0.01, N // 2, False),
        (1e-4, 0.01, N, True),
    ):  # fmt: skip
        rng, left, inside, plain, misfit = np.random.default_rng(1), [], [], [], []
        for _ in range(repeats):
            d = drawn(rng)
            f, shapes, tuned = ring(d)
            kept = np.sort(rng.permutation(N)[:count])
            f, shapes = noisy(rng, f[kept], shapes[kept], df, dshape)
            share = (100 / tuned) ** 2
            found = blades_from_modes(tuned, f, shapes, df, dshape, share, find_tuned=find)
            low, high = found.interval()
            left.append(found.deviation - d)
            inside.append((low < d) & (d < high))
            misfit.append(found.misfit)
            plain.append(equation(tuned, f, shapes, share) - d)
        size = [f"{1e6 * np.sqrt(np.mean(np.square(x))):.0f}" for x in (left, plain)]
        rows.append([
            f"{df:.0e}", f"{100 * dshape:.0f} %", str(count), "found" if find else "known", size[0],
            "" if find else size[1], f"{100 * np.mean(inside):.1f} %", f"{np.mean(misfit):.2f}",
        ])  # fmt: skip
    return [
        "noise of a frequency", "of a shape", "modes of 24", "tuned frequencies", "error, 1e-6",
        "by the equation alone", "in the 95 % interval", "misfit",
    ], rows  # fmt: skip


def equation(tuned: Array, f: Array, shapes: Array, share: Array) -> Array:
    """What (K - omega^2) phi = 0 gives by itself, each equation of the same weight: one quotient a blade."""
    E = identification._Family(tuned, share, False, N)
    omega, p = E.parts(np.zeros(len(tuned)))
    waves = shapes @ E.waves
    g = (waves * p) @ E.waves.T
    b = (waves * ((2 * np.pi * f[:, None]) ** 2 - omega**2) / p) @ E.waves.T
    return np.sqrt(1 + (g * b).sum(axis=0) / (g * g).sum(axis=0)) - 1


def two_masses(deviation: Array, disc: float) -> tuple[Array, Array, Array, Array]:
    """Blades of 1 kg and 100 Hz on a disc of 5 kg a sector: modes of the blade family, tuned ones, energy shares."""

    def family(d: Array) -> tuple[Array, Array]:
        to_next = np.eye(N) - np.roll(np.eye(N), 1, axis=1)
        k = np.diag((1 + d) ** 2)
        K = np.block([[k, -k], [-k, k + disc * (np.eye(N) + 2 * to_next.T @ to_next)]])
        M = np.repeat([1.0, np.sqrt(5.0)], N)
        values, x = np.linalg.eigh(K / np.outer(M, M))
        low = np.argsort(-np.abs(x[:N] ** 2).sum(axis=0))[:N]
        low = low[np.argsort(values[low])]
        return values[low], (x / M[:, None])[:, low]

    values, x = family(deviation)
    squares, y = family(np.zeros(N))
    diameter = np.abs(np.fft.rfft(y[:N], axis=0)).argmax(axis=0)
    tuned, share = (
        np.array([v[diameter == n].mean() for n in range(N // 2 + 1)])
        for v in (squares, ((y[:N] - y[N:]) ** 2).sum(axis=0) / squares)
    )
    return 100 * np.sqrt(values), x[:N].T, 100 * np.sqrt(tuned), share


def model() -> Table:
    """Error of the model itself, without noise, on discs of which a mass a sector moves as well."""
    rows, d = [], drawn(np.random.default_rng(2))
    for disc in (3.0, 10.0, 30.0, 100.0):
        f, shapes, tuned, share = two_masses(d, disc)
        found = [blades_from_modes(tuned, f, shapes, 1e-5, 0.01, s) for s in (1.0, np.minimum(share, 1.0))]
        size = [f"{100 * np.sqrt(np.mean((x.deviation - d) ** 2)) / SPREAD:.1f} %" for x in found]
        rows.append([f"{tuned.min():.1f} to {tuned.max():.1f}", f"{share.min():.3f}", *size, f"{found[1].misfit:.1f}"])
    return ["blade family, Hz", "least energy share", "error, share 1", "error, its own shares", "misfit"], rows


def gauges() -> Table:
    """The interval of k over the number of gauges, of amplitudes whose k is 2."""
    rows = []
    for n in (6, 12, 24, 48, 96):
        w = weibull.quantile((np.arange(n) + 0.5) / n, 1.0, 2.0)
        found = weibull.amplitude_spread(w)
        rows.append([str(n), f"{found.k:.2f}", f"{found.interval[0]:.2f} to {found.interval[1]:.2f}"])
    return ["gauges", "k", "95 % interval"], rows


def picture(upper: Any, lower: Any) -> None:
    """One ring of 24 on two axes: its deviations, and what is found less what is true, with intervals."""
    rng = np.random.default_rng(7)
    d = drawn(rng)
    f, shapes, tuned = ring(d)
    found = blades_from_modes(tuned, *noisy(rng, f, shapes, 1e-4, 0.05), 1e-4, 0.05, (100 / tuned) ** 2)
    blades = np.arange(N)
    upper.bar(blades, 100 * d, color="0.8", label="true")
    upper.plot(blades, 100 * found.deviation, "k.", label="found")
    upper.set_ylabel("frequency deviation, %")
    upper.set_ylim(-1.8, 2.6)
    upper.legend(loc="upper right", ncols=2, frameon=False)
    lower.errorbar(blades, 1e4 * (found.deviation - d), 1e4 * 1.96 * found.accuracy, fmt="k.", capsize=2)
    lower.axhline(0, color="0.6", lw=0.8)
    lower.set_ylabel("found - true, 1e-4\n(bars: 95 % intervals)")
    lower.set_xlabel("blade")
