"""One definite form for shapes that mathematics leaves open: signs, and the basis inside repeated eigenvalues."""

from __future__ import annotations

import numpy as np

from ..data import Array, Indices

CLUSTER = 1e-6  # relative gap of eigenvalues below which they count as repeated


def clusters(values: Array, zero: int = 0) -> list[slice]:
    """Runs of repeated eigenvalues; the first `zero` (rigid) ones form one run."""
    runs, start = ([slice(0, zero)] if zero else []), zero
    for i in range(zero + 1, len(values) + 1):
        if i == len(values) or values[i] - values[i - 1] > CLUSTER * abs(values[i]):
            runs.append(slice(start, i))
            start = i
    return runs


def by_place(points: Array) -> Indices:
    """(3n,) degrees of freedom ordered by the position of their points, so that numbering decides no tie."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    place = np.round((points - points.min(axis=0)) / max(np.ptp(points, axis=0).max(), 1e-300), 6)
    nodes = np.lexsort((place[:, 2], place[:, 1], place[:, 0]))
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def turn_clusters(phi: Array, values: Array, rows: Array, zero: int = 0) -> Array:
    """Rotate each cluster so that its read-out through `rows` is lower triangular.

    Of a pair, the second member then has no u_n at the first interface (or, without one, no displacement along
    the first significant row), whatever basis the eigensolver returned.

    Args:
        phi: (3n, m). values: (m,) eigenvalues. rows: (r, m) read-outs in order of precedence.
    """
    out = phi.copy()
    for run in clusters(values, zero):
        size = run.stop - run.start
        if size < 2:
            continue
        T = rows[:, run]
        norms = np.linalg.norm(T, axis=1)
        Q = np.eye(size, dtype=phi.dtype)
        done = 0
        for i in np.flatnonzero(norms > 1e-3 * norms.max()) if norms.max() > 0 else []:
            v = (T[i] @ Q)[done:]
            if np.linalg.norm(v) < 1e-3 * norms[i]:
                continue
            H, _ = np.linalg.qr(np.column_stack([v.conj(), np.eye(len(v))]))
            Q[:, done:] = Q[:, done:] @ H
            done += 1
            if done == size - 1:
                break
        out[:, run] = phi[:, run] @ Q
    return out


def signs(rows: Array) -> Array:
    """(m,) factors of magnitude 1 that make the entry of largest magnitude real and positive.

    Of near ties (1e-6) the lowest row rules. Real rows get +1 or -1.
    """
    size = np.abs(rows)
    top = size.max(axis=0)
    first = (size >= (1 - 1e-6) * top).argmax(axis=0)
    entry = rows[first, np.arange(rows.shape[1])].conj()
    size = np.abs(entry)
    return np.divide(entry, size, out=np.ones_like(entry), where=size > 0)
