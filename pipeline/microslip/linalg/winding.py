"""How many roots of a quadratic eigenproblem a window holds, counted without looking for any: the argument principle.

The phase of det Q(s) turns by 2 pi round a window for each root inside (Cauchy; used for eigenvalues by Bertrand and
Philippe, 2001). The determinant comes from LU factors along the border, apart from what has been searched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..data import ComplexArray
from .quadratic import DENSE, Quadratic, Window, factors_near

SAFE = np.pi / 2
"""Largest turn of the phase in one step."""

BEND = 0.25
"""Largest difference of the logarithm in the middle of a step from the mean of its ends: 0.55 beside a lone zero."""

STEADY = 0.5
"""Largest difference of its rates along a side, over the largest of them, with which the phase turns steadily."""

SMALLEST = 1e-10
"""Shortest step, over the length of the border."""


@dataclass(frozen=True)
class Count:
    """What went round a window found.

    Attributes:
        missed: roots inside the window that are not among the known ones (pairs counted once; negative: known ones
            that are none). turns: the same, not rounded.
    """

    missed: int
    turns: float


def missed(Q: Quadratic, window: Window, known: ComplexArray) -> Count:
    """How many roots of a window are not among the known ones.

    The phase followed is that of det Q(s) / product of (s - root) (s - conjugate) over the known roots, which is smooth
    beside them: a known root may lie on the border itself. A root that was missed is a zero inside, one turn; one that
    was invented is a pole. Each straight step is halved until the phase turns by less than `SAFE` and the logarithm
    bends by less than `BEND` in its middle; a zero near the border bends it, however the phase is folded.

    Thousands of roots far outside turn the phase steadily, and alike in both halves of a step, by whole turns perhaps:
    exp(c s + d s^2) with the c and d that they have, real and without a zero, is divided out as well.

    A window from the frequency 0 on is counted together with its mirror image, so the path begins and ends on the real
    axis and never runs along it, where real roots lie.

    Args:
        known: (r,) roots in the window and around it, frequencies not below 0.
    """
    smooth = _Smooth(Q, known)
    if Q.n > DENSE:
        smooth.calm(window)
    path = _border(window)
    length = float(np.abs(np.diff(path)).sum())
    total = 0.0
    for a, b in zip(path[:-1], path[1:], strict=True):
        for part in np.linspace(0, 1, 5)[:-1]:
            begin, end = a + part * (b - a), a + (part + 0.25) * (b - a)
            total += _turn(smooth, begin, end, SMALLEST * length)
    mirrored = window.omega[0] == 0
    turns = total / (np.pi if mirrored else 2 * np.pi)
    count = round(turns)
    return Count(-(-count // 2) if mirrored else count, turns / (2 if mirrored else 1))


def _border(window: Window) -> ComplexArray:
    """Corners in the order of the path, counter-clockwise; open along the real axis."""
    (a, b), (c, d) = window.growth, window.omega
    corners = [complex(b, c), complex(b, d), complex(a, d), complex(a, c)]
    return np.array(corners if c == 0 else [*corners, corners[0]])


class _Smooth:
    """log of det Q(s) without the known roots, kept where it has been computed."""

    def __init__(self, Q: Quadratic, known: ComplexArray) -> None:
        self._Q = Q
        pairs = known[known.imag > 0]
        self._known = np.concatenate([pairs, pairs.conj(), known[known.imag == 0]])
        self.at: dict[complex, complex] = {}
        self._steady = (0.0, 0.0)

    def calm(self, window: Window) -> None:
        """Find what turns the phase steadily: its rate along both sides of the window, where that is about the same in
        three places; else roots nearby turn it, and nothing is taken out."""
        (a, b), (c, d) = window.growth, window.omega
        step = 1e-4 * (d - c)
        middles = c + np.array([0.25, 0.5, 0.75]) * (d - c)
        rates = np.array([[_fold(self(complex(g, w + step)) - self(complex(g, w))).imag / step for w in middles]
                          for g in (a, b)])  # fmt: skip
        if np.ptp(rates, axis=1).max() <= STEADY * np.abs(rates).max():
            left, right = np.median(rates, axis=1)
            slope = (right - left) / (b - a)
            self._steady = (float(left - slope * a), float(slope))
            self.at.clear()

    def __call__(self, s: complex) -> complex:
        if s not in self.at:
            away = s - self._known
            away = np.where(away == 0, 1e-300, away)
            c, d = self._steady
            steady = s * (c + 0.5 * d * s)
            self.at[s] = factors_near(self._Q, s).log_determinant() - complex(np.log(away).sum()) - steady
        return self.at[s]


def _turn(f: Callable[[complex], complex], a: complex, b: complex, least: float) -> float:
    """Change of the phase along a straight step, by halves."""
    middle = 0.5 * (a + b)
    low, half, high = f(a), f(middle), f(b)
    first, second = _fold(half - low), _fold(high - half)
    bend = abs(first - second) / 2
    turned = max(abs(first.imag), abs(second.imag))
    if (turned <= SAFE and bend <= BEND) or abs(b - a) <= least:
        return first.imag + second.imag
    return _turn(f, a, middle, least) + _turn(f, middle, b, least)


def _fold(z: complex) -> complex:
    """The difference of two logarithms with its phase between -pi and pi."""
    return complex(z.real, (z.imag + np.pi) % (2 * np.pi) - np.pi)
