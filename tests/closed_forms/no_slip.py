"""Kalker's linear theory: an ellipse of like half-spaces rolls without slip; rectangles of constant traction."""

from __future__ import annotations

import numpy as np


def influence(x, y, half_x, half_y, poisson):
    """(xx, xy, yy): u_x by p_x, u_x by p_y, u_y by p_y of a rectangle so far away, times pi G (Johnson 3.6)."""

    def corners(f):
        return (f(x + half_x, y + half_y) + f(x - half_x, y - half_y)
                - f(x + half_x, y - half_y) - f(x - half_x, y + half_y))  # fmt: skip

    yy = corners(lambda x, y: x * np.arcsinh(y / np.abs(x)))  # the integral of y^2 / r^3
    xx = corners(lambda x, y: y * np.arcsinh(x / np.abs(y)))
    xy = corners(lambda x, y: -np.hypot(x, y))
    whole = (1 - poisson) * (xx + yy)
    return whole + poisson * xx, poisson * xy, whole + poisson * yy


def coefficients(ratio: float, poisson: float, along: int, across: int = 28) -> np.ndarray:
    """C11, C22, C23 by the force of spin, C23 by the moment of creepage, C33, of strips with so many elements along.

    Both halves y > 0 and y < 0 mirror each other, u(x) = u(x + dx) - w dx with nothing ahead of the leading edge.
    """
    a, b = np.sqrt(ratio), 1 / np.sqrt(ratio)
    edges = b * np.sin(np.linspace(0, np.pi / 2, across // 2 + 1))  # narrower towards the tip
    middles = 0.5 * (edges[1:] + edges[:-1])
    reach = a * np.sqrt(1 - (middles / b) ** 2)
    x = (reach[:, None] * (1 - (2 * np.arange(along) + 1) / along)).ravel()
    y, half_x = np.repeat(middles, along), np.repeat(reach / along, along)
    half_y = np.repeat(0.5 * np.diff(edges), along)
    area, step, none = 4 * half_x * half_y, 2 * half_x, np.zeros_like(x)

    def displacement(at, parity):
        near, far = (influence(at[:, None] - x, y[:, None] - s * y, half_x, half_y, poisson) for s in (1, -1))
        return np.block([
            [near[0] + parity * far[0], near[1] - parity * far[1]],
            [near[1] + parity * far[1], near[2] - parity * far[2]],
        ]) / np.pi  # fmt: skip

    found = {}
    slips = {1: {"xi": (-step, none)}, -1: {"eta": (none, -step), "phi": (y * step, -(x + half_x) * step)}}
    for parity, rigid in slips.items():
        matrix = displacement(x, parity) - displacement(x + step, parity)
        tractions = np.linalg.solve(matrix, np.array([np.concatenate(w) for w in rigid.values()]).T)
        for name, p in zip(rigid, tractions.T, strict=True):
            X, Y = p[: len(x)] * area, p[len(x) :] * area
            found[name] = (1 + parity) * X.sum(), (1 - parity) * Y.sum(), (1 - parity) * (Y * x - X * y).sum()
    return np.array([-found["xi"][0], -found["eta"][1], -found["phi"][1], found["eta"][2], -found["phi"][2]])


def extrapolated(ratio: float, poisson: float, along: int = 32) -> np.ndarray:
    """To elements of no length: their error is of first order."""
    return 2 * coefficients(ratio, poisson, along) - coefficients(ratio, poisson, along // 2)
