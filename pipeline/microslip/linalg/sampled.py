"""One basis for the roots of a family over a range of a parameter, and at any value of it all roots in a window.

Eigenvectors at a few sampled values span it (Graebner et al., ZAMM 96, 2016, 1388); the matrices are projected once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..data import Array, ComplexArray
from ..errors import NotConverged
from ..progress import Report
from .parametric import Family
from .quadratic import Factors, Quadratic, Window, every_value, search

MOST_SAMPLES = 24
SKETCH = 64
"""Random combinations of rows by which the size of a residual is known to a tenth."""

CAUTION = 5.0
"""Times the largest ratio of a true error to the residual's, seen at the values held out."""

CUT = 3.0
"""Times the tolerance: directions of the sampled vectors that are smaller, over the largest, are left out."""

STRANGER = 1e-3
"""Estimated relative error beyond which a root of the projected matrices is none of the body's."""


@dataclass(frozen=True)
class Sampled:
    """Roots over a range of one parameter.

    Attributes:
        V: (n, m) orthonormal, real. reduced: the family on it. sketched: its matrices on it, by `SKETCH` random
            combinations of rows. parameter, window: what it was made for. values: the other parameters' values.
        samples: (k,) values of the parameter at which the full matrices were searched. held_out: (h,) those of them
            that were compared with the basis of the others first; held_out_error: (h,) largest relative error of a root
            found there. gain: true error over what a residual alone would say, the largest seen.
    """

    V: Array
    reduced: Family
    sketched: Family
    parameter: str
    window: Window
    values: Mapping[str, float]
    samples: Array
    held_out: Array
    held_out_error: Array
    gain: float

    def at(self, value: float) -> tuple[ComplexArray, Array, ComplexArray]:
        """Roots in the window, (r,) estimated errors, 1/s, and (m, r) vectors on the basis.

        Raises:
            UserError: a value at which a matrix is not defined.
        """
        s, residual, x = self._residuals(value)
        error = CAUTION * self.gain * residual
        own = (error <= STRANGER * np.abs(s)) & self.window.holds(s)
        return s[own], error[own], x[:, own]

    def _residuals(self, value: float) -> tuple[ComplexArray, Array, ComplexArray]:
        """Roots in and beside the window, |Q x| over |y^H Q' x|, and vectors."""
        values = {**self.values, self.parameter: value}
        Q, sketch = self.reduced.at(values), self.sketched.at(values)
        s = every_value(Q)
        s = s[_wider(self.window).holds(s)]
        s = s[np.argsort(s.imag, kind="stable")]
        vectors = np.empty((Q.n, len(s)), dtype=complex)
        residual = np.empty(len(s))
        for i, root in enumerate(s):
            vectors[:, i], y = _both_vectors(Q, root)
            rest = np.linalg.norm(sketch.at(root) @ vectors[:, i])
            residual[i] = float(rest) / max(abs(complex(np.vdot(y, Q.slope(root, vectors[:, i])))), 1e-300)
        return s, residual, vectors


def _wider(window: Window) -> Window:
    """A window with a margin, in which roots on its border are still known."""
    margins = [1e-2 * max(abs(a), abs(b)) for a, b in (window.growth, window.omega)]
    (a, b), (c, d) = window.growth, window.omega
    return Window((a - margins[0], b + margins[0]), (max(c - margins[1], 0.0), d + margins[1]))


def _both_vectors(Q: Quadratic, s: complex) -> tuple[ComplexArray, ComplexArray]:
    """Right and left vector of a root known to the last digits, by one step of inverse iteration."""
    start = np.cos(1.0 + np.arange(Q.n))
    try:
        factors = Factors(Q.at(s))
    except ZeroDivisionError:
        factors = Factors(Q.at(s * (1 + 1e-13)))
    x, y = factors.solve(start), factors.solve(start, adjoint=True)
    return x / np.linalg.norm(x), y / np.linalg.norm(y)


def sampled(
    family: Family, parameter: str, low: float, high: float, window: Window, *, tolerance: float = 1e-7,
    values: Mapping[str, float] | None = None, report: Report = lambda _: None,
) -> Sampled:  # fmt: skip
    """A basis for all roots of a window at every value of a parameter from low to high.

    Both ends and the middle are sampled first. Then the value with the largest estimated error is held out: the full
    matrices are searched there and compared with the basis. It joins the basis; done when it agreed to the tolerance.

    Args:
        tolerance: largest relative error of a root at the values held out. values: of the other parameters.

    Raises:
        UserError: a value at which a matrix is not defined. NotConverged: more than `MOST_SAMPLES` would be needed.
    """
    family, fixed = family.merged(), dict(values or {})
    steps = np.geomspace if low > 0 else np.linspace
    at, vectors = list[float](), list[ComplexArray]()

    def search_at(value: float) -> ComplexArray:
        report(f"{parameter} = {value:.6g}: all roots of {family.terms[0].matrix.shape[0]} coordinates")
        found = search(family.at({**fixed, parameter: value}), window)
        at.append(value)
        vectors.append(found.x)
        return found.s

    for value in steps(low, high, 3):
        search_at(float(value))
    held, errors, gains = list[float](), list[float](), list[float]()
    while True:
        basis = _basis_of(family, parameter, window, fixed, vectors, at, held, errors, gains, tolerance)
        value = _worst(basis, np.sort(at), steps)
        s, residual, _ = basis._residuals(value)
        true = search_at(value)
        true = true[window.holds(true)]
        distance = np.abs(s[None] - true[:, None]) if len(s) else np.full((len(true), 1), np.inf)
        near = distance.argmin(axis=1)
        error = distance[np.arange(len(true)), near]
        held.append(value)
        errors.append(float((error / np.abs(true)).max(initial=0.0)))
        gains.append(float((error / np.maximum(residual[near], 1e-300)).max(initial=0.0)) if len(s) else 1.0)
        if errors[-1] <= tolerance:
            return _basis_of(family, parameter, window, fixed, vectors, at, held, errors, gains, tolerance)
        if len(at) >= MOST_SAMPLES:
            raise NotConverged(
                f"{parameter} from {low:g} to {high:g}: {len(at)} samples leave an error of {errors[-1]:.1e}; give a "
                "shorter range or a larger tolerance"
            )


def _basis_of(
    family: Family, parameter: str, window: Window, fixed: Mapping[str, float], vectors: list[ComplexArray],
    at: list[float], held: list[float], errors: list[float], gains: list[float], tolerance: float,
) -> Sampled:  # fmt: skip
    x = np.hstack(vectors)
    U, size, _ = np.linalg.svd(np.hstack([x.real, x.imag]), full_matrices=False)
    V = U[:, size > CUT * tolerance * size[0]]
    n = len(V)
    rows = np.random.default_rng(2).standard_normal((n, SKETCH)) / np.sqrt(SKETCH)
    gain = max(gains, default=1.0)
    return Sampled(
        V, family.projected(V), family.projected(V, rows), parameter, window, fixed, np.sort(at), np.array(held),
        np.array(errors), gain,
    )  # fmt: skip


def _worst(basis: Sampled, at: Array, steps: Callable[..., Array]) -> float:
    """The value in the middle between two samples at which the estimated relative error is largest."""
    middles = [float(steps(a, b, 3)[1]) for a, b in zip(at[:-1], at[1:], strict=True)]
    told = []
    for value in middles:
        s, residual, _ = basis._residuals(value)
        told.append(float((residual / np.maximum(np.abs(s), 1e-300)).max(initial=0.0)))
    return middles[int(np.argmax(told))]
